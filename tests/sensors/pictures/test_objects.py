from dataclasses import replace

import numpy as np
import pytest

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import list_objects, load_object
from artiskill.errors import ConfigError
from artiskill.sensors.pictures.objects import ObjectView, render_object

SMALL = {"width": 96, "height": 72}


@pytest.fixture(scope="module")
def cabinet() -> ArticulatedObject:
    """One with several joints, whatever the catalogue's numbers."""
    cabinets = (load_object(object_id) for object_id in list_objects("cabinet"))
    return next(obj for obj in cabinets if len(obj.jointed_links) >= 3)


@pytest.fixture(scope="module")
def closed(cabinet) -> np.ndarray:
    return render_object(cabinet, **SMALL)


def test_a_picture_is_of_the_size_asked_for_and_repeats_itself(cabinet, closed):
    assert closed.shape == (72, 96, 3)
    assert closed.dtype == np.uint8
    np.testing.assert_array_equal(render_object(cabinet, 0.0, **SMALL), closed)


def test_open_joints_and_other_sides_are_seen(cabinet, closed):
    for other in ({"joint_fractions": 0.8}, {"azimuth_deg": 100.0}, {"distance_m": 6.0}, {"target_w": (0, 0, 2)}):
        changed = (render_object(cabinet, **SMALL, **other) != closed).any(axis=-1)
        assert changed.mean() > 0.05, other


def test_one_joint_alone_changes_its_part_of_the_picture(cabinet):
    view = ObjectView(cabinet)
    camera = view.camera((0.0, 1.0), **SMALL)
    shares = np.zeros(len(cabinet.jointed_links))
    shares[0] = 1.0
    before, one, all_open = (view.draw(state, camera).astype(int) for state in (0.0, shares, 1.0))
    changed = [(np.abs(after - before).max(axis=-1) > 8).mean() for after in (one, all_open)]
    assert 0.002 < changed[0] < 0.7 * changed[1]


def test_the_object_stands_inside_the_picture(cabinet):
    """The ground surrounds it: nothing at the picture's edges depends on the object's joints."""
    view = ObjectView(cabinet)
    camera = view.camera((0.0, 1.0), width=160, height=120)
    images = view._renderer.render(
        np.zeros((len(cabinet.links), 3)), np.tile((1.0, 0, 0, 0), (len(cabinet.links), 1)), [camera], ("geom",)
    )
    edges = [images.geom[0][0], images.geom[0][-1], images.geom[0][:, 0], images.geom[0][:, -1]]
    assert max(edge.max() for edge in edges) < 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"joint_fractions": 1.5}, r"\[0, 1\]"),
        ({"joint_fractions": (0.0,)}, r"has \d joints"),
        ({"elevation_deg": 91.0}, "elevation"),
        ({"height": 0}, "height"),
        ({"distance_m": -1.0}, "distance"),
    ],
)
def test_bad_arguments_are_named(cabinet, change, message):
    with pytest.raises(ConfigError, match=message):
        render_object(cabinet, **{**SMALL, **change})


def test_a_hung_cabinet_is_seen_from_behind_without_its_wall():
    hung = load_object("cabinet-0002")
    behind, before = (render_object(hung, width=96, height=72, azimuth_deg=azimuth) for azimuth in (0, 180))
    alone = replace(hung, links=tuple(hung.links[i] for i in hung.own_links))
    np.testing.assert_array_equal(behind, render_object(alone, width=96, height=72, azimuth_deg=0))
    assert behind.reshape(-1, 3).std(axis=0).min() > 10
    assert (before != render_object(alone, width=96, height=72, azimuth_deg=180)).any()
