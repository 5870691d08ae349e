"""Samplers: who is chosen, how many, and that nothing else matters but the generator."""

import numpy as np
import pytest

from artiskill.errors import ArtiSkillError, ConfigError, UnknownNameError
from artiskill.sensors.observations.sampling import (
    SAMPLERS,
    ManiskillSampler,
    choose_farthest,
    downsample,
    first_of_each_voxel,
    make_sampler,
    points_that_count,
)


def cloud(counts: dict[tuple[int, ...], int], ground: int = 500, seed: int = 0) -> tuple[np.ndarray, ...]:
    """Points by the masks they lie in, shuffled, with ground among them: xyz, rgb, seg (k = 3)."""
    rng = np.random.default_rng(seed)
    rows = [np.isin(np.arange(3), masks) for masks, count in counts.items() for _ in range(count)]
    rows += [rng.random(3) < 0.5 for _ in range(ground)]
    seg = np.array(rows).reshape(-1, 3)
    xyz = rng.uniform(-1, 1, (len(seg), 3)).astype(np.float32)
    xyz[:, 2] = rng.uniform(0.01, 1, len(seg))
    xyz[len(seg) - ground :, 2] = rng.choice([-0.5, 0.0, 1e-3], ground)
    rgb = rng.integers(0, 256, (len(seg), 3), dtype=np.uint8)
    order = rng.permutation(len(seg))
    return xyz[order], rgb[order], seg[order]


def rows_of(part: np.ndarray, whole: np.ndarray) -> list[int]:
    """For each row of `part` its place in `whole`, whose rows differ."""
    places = {row.tobytes(): i for i, row in enumerate(whole)}
    return [places[row.tobytes()] for row in part]


PLENTY = {(0, 1): 300, (1,): 2000, (2,): 3000, (): 5000}


def test_the_baselines_recipe() -> None:
    xyz, rgb, seg = cloud(PLENTY)
    few = downsample(xyz, rgb, seg, ManiskillSampler(), np.random.default_rng(0))
    chosen = rows_of(few["xyz"], xyz)
    assert len(set(chosen)) == 1200
    np.testing.assert_array_equal(few["rgb"], rgb[chosen])
    np.testing.assert_array_equal(few["seg"], seg[chosen])
    assert few["xyz"][:, 2].min() > 1e-3
    for mask in range(3):
        assert few["seg"][50 * mask : 50 * (mask + 1), mask].all(), "50 of each mask come first"
    assert few["seg"][:800].any(axis=1).all()
    assert not few["seg"][800:].any()


def test_rare_masks_are_taken_whole_and_the_rest_is_zero() -> None:
    xyz, rgb, seg = cloud({(0, 1): 7, (1,): 20, (2,): 60, (): 100})
    few = downsample(xyz, rgb, seg, ManiskillSampler(), np.random.default_rng(0))
    assert few["seg"].sum(axis=0).tolist() == [7, 27, 60]
    assert len(set(rows_of(few["xyz"][:187], xyz))) == 187
    assert not any(few[name][187:].any() for name in few)


def test_unmasked_points_fill_up_what_masked_ones_leave() -> None:
    xyz, rgb, seg = cloud({(2,): 100, (): 5000})
    few = downsample(xyz, rgb, seg, ManiskillSampler(), np.random.default_rng(0))
    assert few["seg"].any(axis=1).sum() == 100
    assert (few["xyz"][:, 2] > 1e-3).sum() == 1200


@pytest.mark.parametrize("method", SAMPLERS)
def test_same_generator_same_points(method: str) -> None:
    xyz, rgb, seg = cloud(PLENTY)
    sampler = make_sampler(method, 1200)
    first, again, other = (downsample(xyz, rgb, seg, sampler, np.random.default_rng(s)) for s in (3, 3, 4))
    for name in first:
        np.testing.assert_array_equal(first[name], again[name])
    assert (first["xyz"] != other["xyz"]).any()
    assert len(set(rows_of(first["xyz"], xyz))) == 1200
    assert first["xyz"][:, 2].min() > 1e-3
    np.testing.assert_array_equal(first["seg"], seg[rows_of(first["xyz"], xyz)])


@pytest.mark.parametrize("method", SAMPLERS)
@pytest.mark.parametrize("counts", [{}, {(1,): 1}, {(): 5}])
def test_hardly_any_points(method: str, counts: dict) -> None:
    xyz, rgb, seg = cloud(counts)
    few = downsample(xyz, rgb, seg, make_sampler(method, 64), np.random.default_rng(0))
    assert few["xyz"].shape == (64, 3)
    found = sum(counts.values())
    assert len(set(rows_of(few["xyz"][:found], xyz))) == found
    assert not few["xyz"][found:].any()


def test_every_point_of_a_mask_is_as_likely() -> None:
    xyz, rgb, seg = cloud({(0,): 200, (): 2000}, ground=10)
    hits = np.zeros(len(xyz))
    for s in range(300):
        few = downsample(xyz, rgb, seg, make_sampler("maniskill", 200), np.random.default_rng(s))
        hits[rows_of(few["xyz"], xyz)] += 1
    masked = hits[seg[:, 0] & (xyz[:, 2] > 1e-3)] / 300
    assert masked.mean() == pytest.approx(133 / 200)
    assert masked.std() < 0.04, "the spread of 300 fair draws is 0.027"


def test_a_voxel_gives_one_point() -> None:
    xyz = np.random.default_rng(0).uniform(-2, 2, (5000, 3)).astype(np.float32)
    firsts = first_of_each_voxel(xyz, 0.25)
    cells = np.floor(xyz.astype(np.float64) / 0.25).astype(int)
    _, expected = np.unique(cells, axis=0, return_index=True)
    np.testing.assert_array_equal(firsts, np.sort(expected))


def test_farthest_points_by_definition() -> None:
    xyz = np.random.default_rng(0).normal(size=(300, 3)).astype(np.float32)
    chosen = choose_farthest(xyz, 40)
    gaps = np.linalg.norm(xyz[:, None] - xyz[None], axis=-1)
    assert chosen[0] == 0
    for i in range(1, 40):
        nearest = gaps[:, chosen[:i]].min(axis=1)
        assert nearest[chosen[i]] == pytest.approx(nearest.max(), rel=1e-5)


def test_identical_points_are_still_distinct_choices() -> None:
    assert sorted(choose_farthest(np.zeros((30, 3), np.float32), 30)) == list(range(30))


def test_points_that_are_not_finite_do_no_harm() -> None:
    xyz, rgb, seg = cloud(PLENTY)
    xyz[::3] = np.nan
    xyz[1::50] = np.inf
    for method in SAMPLERS:
        few = downsample(xyz, rgb, seg, make_sampler(method, 300), np.random.default_rng(0))
        assert not np.isnan(few["xyz"]).any()


@pytest.mark.parametrize("size", [0, 1, 7, 8, 9, 64, 1003])
def test_counting_eight_at_a_time_misses_nothing(size: int) -> None:
    codes = np.where(np.random.default_rng(size).random(size) < 0.2, 129, 0).astype(np.uint8)
    np.testing.assert_array_equal(points_that_count(codes), np.flatnonzero(codes))


@pytest.mark.parametrize(
    ("method", "number", "settings", "error", "says"),
    [
        ("farthest", 1200, {}, UnknownNameError, "fps"),
        ("fps", 0, {}, ConfigError, "num_points"),
        ("fps", 12.5, {}, ConfigError, "num_points"),
        ("fps", 100, {"candidates_per_point": 0}, ConfigError, "candidates_per_point"),
        ("voxel", 100, {"voxel_m": -1.0}, ConfigError, "voxel_m"),
        ("voxel", 100, {"voxel": 0.1}, ConfigError, "voxel_m"),
        ("maniskill", 100, {"masked_points": 101}, ConfigError, "masked_points"),
        ("maniskill", 1200, {"points_per_mask": 200}, ConfigError, "points_per_mask"),
    ],
)
def test_illegal_settings(
    method: str, number: int, settings: dict, error: type[ArtiSkillError], says: str
) -> None:
    with pytest.raises(error, match=says):
        make_sampler(method, number, settings)


def test_shares_are_numbers_of_points_of_each_mask() -> None:
    """A point in two masks counts as of the first; what is missing of a mask is given to no other."""
    xyz, rgb, seg = cloud({(0, 1): 40, (1,): 100, (2,): 30, (): 3})
    few = downsample(
        xyz, rgb, seg, make_sampler("shares", 60, {"shares": (24, 26, 0, 10)}), np.random.default_rng(1)
    )
    masks = few["seg"][: 24 + 26 + 3]
    assert masks[:, 0].sum() == 24
    assert (masks[:, 1] & ~masks[:, 0]).sum() == 26
    assert not masks[:, 2].any()
    assert not few["xyz"][53:].any()
    assert len(np.unique(rows_of(few["xyz"][:53], xyz))) == 53


def test_shares_must_add_up() -> None:
    with pytest.raises(ConfigError, match="sum of shares"):
        make_sampler("shares", 60, {"shares": (30, 20)})
