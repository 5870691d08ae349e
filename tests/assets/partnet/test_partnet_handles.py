"""Fronts that stand in their frame are set free, and grasp poses are offered where the gripper has room."""

from pathlib import Path

import numpy as np
import pytest
from benchmarks.partnet_folders import ToyLink, block, write_object

from artiskill.assets.articulated_object import ArticulatedObject, CollisionShape
from artiskill.assets.handles import handle_from_mesh
from artiskill.assets.partnet import import_partnet
from artiskill.assets.partnet.collisions import hull_shape, shape_hull, trim_overlaps
from artiskill.assets.partnet.handles import FINGER, HAND, OPEN_M, Obstacle, with_clearance
from artiskill.checks.config import default_checks_config
from artiskill.checks.context import CheckContext
from artiskill.checks.handles import check_handles
from artiskill.checks.model import check_closed
from artiskill.geometry.meshes import TriMesh, convex_hull, merge
from artiskill.geometry.primitives import box
from artiskill.robots.arm_config import load_arm
from artiskill.robots.config import load_robot

OVERLAP_M, GAP_M = 0.0049, 0.0095  # of the front and the frame; between the panel and the bar


def crowded() -> list[ToyLink]:
    """A drawer whose front stands 4.9 mm in the frame, and a door whose bar leaves fingertips no room."""
    walls = [
        block((-0.2, -0.32, 0.0), (0.2, -0.3, 0.6)),
        block((-0.2, 0.3, 0.0), (0.2, 0.32, 0.6)),
        block((-0.2, -0.3, 0.0), (0.2, 0.3, 0.02)),
        block((-0.2, -0.3, 0.58), (0.2, 0.3, 0.6)),
        block((0.18, -0.3, 0.02), (0.2, 0.3, 0.58)),
    ]
    drawer = [
        ("drawer_front", block((-0.22, -0.3 - OVERLAP_M, 0.4), (-0.19, 0.3 + OVERLAP_M, 0.56))),
        ("drawer_box", block((-0.19, -0.28, 0.42), (0.15, 0.28, 0.43))),
        ("handle", _bar((-0.22, 0.0, 0.48), 0.03, upright=False)),
    ]
    door = [
        ("door_surface", block((-0.22, -0.29, 0.03), (-0.2005, 0.29, 0.39))),
        ("handle", _bar((-0.22, 0.25, 0.2), GAP_M, upright=True)),
    ]
    return [
        ToyLink("link_0", "base", "fixed", [("frame", wall) for wall in walls]),
        ToyLink("link_1", "link_0", "prismatic", drawer, axis=(-1, 0, 0), limits=(0, 0.3)),
        ToyLink("link_2", "link_0", "revolute", door, (-0.2, -0.29, 0), (0, 0, 1), (0, 1.5)),
    ]


def _bar(at: tuple[float, float, float], gap: float, upright: bool) -> TriMesh:
    """A bar of 10 x 6 mm, 160 mm long, on two posts that hold it so far from a panel at x = `at[0]`."""
    posts = [block((-gap - 0.001, s * 0.075 - 0.004, -0.004), (0.0, s * 0.075 + 0.004, 0.004)) for s in (-1, 1)]
    mesh = merge((block((-gap - 0.006, -0.08, -0.005), (-gap, 0.08, 0.005)), *posts))
    turned = TriMesh(mesh.vertices[:, [0, 2, 1]], mesh.faces[:, ::-1]) if upright else mesh
    return turned.transformed(at)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_object(tmp_path_factory.mktemp("crowded") / "crowded", "StorageFurniture", crowded())


@pytest.fixture(scope="module")
def cabinet(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> ArticulatedObject:
    return import_partnet(folder, scale=1.0, cache_dir=tmp_path_factory.mktemp("cache"))


def test_the_front_is_set_free_and_told(cabinet):
    config = default_checks_config()
    results = check_closed(CheckContext(cabinet, config))
    assert [result.value for result in results] == [0.0]
    told = [text for text in cabinet.metadata["warnings"] if "trimmed" in text]
    assert told == ["collision shapes of 'link_1' and 'base' overlapped at rest: trimmed by up to 4.9 mm"]
    front = [shape for shape in cabinet.links[1].collisions if shape.part == "drawer_front"]
    low, high = (f([shape_hull(s).mesh.bounds for s in front], axis=0) for f in (np.min, np.max))
    assert high[1][1] - low[0][1] == pytest.approx(0.6, abs=0.001)  # as wide as the frame is open
    assert high[1][2] - low[0][2] == pytest.approx(0.16, abs=1e-6)  # and as high as it is drawn


def test_offered_grasps_are_possible(cabinet):
    config = default_checks_config()
    results = check_handles(CheckContext(cabinet, config))
    assert [(result.passed, result.note) for result in results if not result.passed] == []
    assert [h.grasp_positions.shape for h in cabinet.handles] == [(2, 3), (2, 3)]
    door = cabinet.handles_of("link_2")[0]
    face = door.points[:, 0].min()
    assert door.grasp_positions[0, 0] - face < 0.0075  # the usual pose is 3 mm, half of the bar, behind its face
    assert not [text for text in cabinet.metadata["warnings"] if "link_1" in text and "grasp" in text]


def test_the_report_tells_what_the_importer_did(folder, tmp_path, monkeypatch, capsys):
    from artiskill.cli.main import main

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    main(["assets", "check", str(folder), "--workers", "1"])
    printed = capsys.readouterr().out
    assert "crowded: collision shapes of 'link_1' and 'base' overlapped at rest: trimmed by up to" in printed


def test_the_gripper_is_the_robots():
    arm = load_arm(load_robot(default_checks_config().grip.robot).arm)
    pad_z = arm.finger.position_m[2] + arm.finger.pad_m[2]
    boxes = [(arm.hand.collisions, 0.0, [HAND]), (arm.finger.collisions, arm.finger.position_m[2], list(FINGER))]
    for shapes, above, ours in boxes:
        assert len(shapes) == len(ours)
        for shape, (middle, half, turn) in zip(shapes, ours, strict=True):
            assert shape.kind == "box"
            np.testing.assert_allclose(middle, np.add(shape.position_m, (0, 0, above - pad_z)), atol=1e-9)
            np.testing.assert_allclose(half, shape.size, atol=1e-9)
            np.testing.assert_allclose(shape.rpy_rad, (turn, 0, 0), atol=1e-9)
    assert arm.finger.range_m[1] == OPEN_M


def handle(gap_m: float):
    """A bar in front of a panel in the plane x = 0, and the two as obstacles."""
    bar = box((0.005, 0.05, 0.006)).transformed((-gap_m - 0.005, 0, 0))
    found = handle_from_mesh(
        "link_1", "bar", bar, np.array((-1.0, 0, 0)), np.random.default_rng(0), hookable=False
    )
    panel = convex_hull(box((0.01, 0.3, 0.3)).transformed((0.01, 0, 0)).vertices)
    return found, bar.vertices, [Obstacle(convex_hull(bar.vertices), ""), Obstacle(panel, "link_1")]


@pytest.mark.parametrize(("gap_m", "moved_m"), [(0.03, 0.0), (0.004, 0.0), (0.003, 0.001), (0.0011, 0.003)])
def test_less_depth_where_the_panel_is_near(gap_m, moved_m):
    """The tips reach 8.5 mm behind a pose that is 5 mm behind the face of a bar 10 mm thick."""
    usual, vertices, obstacles = handle(gap_m)
    found, said = with_clearance(usual, vertices, obstacles)
    away = found.grasp_positions[0] - usual.grasp_positions[0]
    np.testing.assert_allclose(away, (-moved_m, 0, 0), atol=1e-9)
    assert bool(said) == (moved_m > 0)


def test_another_place_where_something_stands_in_the_middle():
    usual, vertices, obstacles = handle(0.03)
    stud = convex_hull(box((0.02, 0.004, 0.012)).transformed((-0.045, 0, 0.02)).vertices)
    found, said = with_clearance(usual, vertices, [*obstacles, Obstacle(stud, "base")])
    assert abs(found.grasp_positions[0][1]) == pytest.approx(0.0125) or abs(found.grasp_positions[0][1]) > 0.0125
    assert len(said) == 1


def test_a_handle_without_room_says_so():
    usual, vertices, obstacles = handle(0.03)
    wall = convex_hull(box((0.05, 0.3, 0.3)).transformed((-0.07, 0, 0)).vertices)
    _, (said,) = with_clearance(usual, vertices, [*obstacles, Obstacle(wall, "base")])
    assert "no room for the gripper" in said
    assert "'base'" in said


def shape(low: tuple[float, ...], high: tuple[float, ...], part: str = "frame") -> CollisionShape:
    return hull_shape(block(low, high).vertices, part)


def test_trimming_cuts_the_moving_shape_and_leaves_what_is_deep_or_a_bearing():
    frame = shape((0, 0, 0), (1, 0.1, 1))
    places = [("base", np.zeros(3)), ("link_1", np.array((0.0, 0.05, 0.0)))]
    ((still,), (cut,)), said = trim_overlaps(places, [[frame], [shape((0.2, 0.045, 0.2), (0.8, 0.145, 0.8))]])
    assert still is frame
    assert cut.kind == "box"
    assert cut.position[1] + 0.05 - cut.size[1] == pytest.approx(0.1002)
    assert said == ["collision shapes of 'link_1' and 'base' overlapped at rest: trimmed by up to 5.0 mm"]
    for other in (
        shape((0.2, 0.03, 0.2), (0.8, 0.145, 0.8)),  # 20 mm
        shape((0.2, 0.045, 0.2), (0.8, 0.145, 0.8), "hinge"),
        shape((0.2, 0.0496, 0.2), (0.8, 0.145, 0.8)),  # 0.4 mm: legal
    ):
        kept, silent = trim_overlaps(places, [[frame], [other]])
        assert kept[1] == (other,)
        assert silent == []
    thin = shape((0.2, 0.045, 0.2), (0.8, 0.052, 0.8))  # nearly all of it is in the frame, which gives way
    ((given_way,), kept_thin), _ = trim_overlaps(places, [[frame], [thin]])
    assert kept_thin == (thin,)
    assert given_way.size[1] == pytest.approx(0.0474)
