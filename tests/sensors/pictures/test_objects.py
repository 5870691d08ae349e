from dataclasses import replace

import numpy as np
import pytest

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import list_objects, load_object
from artiskill.errors import ConfigError
from artiskill.sensors.pictures.objects import ObjectView, OrbitView, render_object

SMALL = OrbitView(96, 72)


@pytest.fixture(scope="module")
def cabinet() -> ArticulatedObject:
    """One with several joints, whatever the catalogue's numbers."""
    cabinets = (load_object(object_id) for object_id in list_objects("cabinet"))
    return next(obj for obj in cabinets if len(obj.jointed_links) >= 3)


@pytest.fixture(scope="module")
def closed(cabinet) -> np.ndarray:
    return render_object(cabinet, view=SMALL)


def test_a_picture_is_of_the_size_asked_for_and_repeats_itself(cabinet, closed):
    assert closed.shape == (72, 96, 3)
    assert closed.dtype == np.uint8
    np.testing.assert_array_equal(render_object(cabinet, 0.0, SMALL), closed)


def test_open_joints_and_other_sides_are_seen(cabinet, closed):
    others = [
        replace(SMALL, azimuth_deg=100.0),
        replace(SMALL, distance_m=6.0),
        replace(SMALL, target_w=(0, 0, 2)),
    ]
    pictures = [render_object(cabinet, 0.8, SMALL), *(render_object(cabinet, view=other) for other in others)]
    assert min((picture != closed).any(axis=-1).mean() for picture in pictures) > 0.05


def test_one_joint_alone_changes_its_part_of_the_picture(cabinet):
    view = ObjectView(cabinet)
    camera = view.camera((0.0, 1.0), SMALL)
    shares = np.zeros(len(cabinet.jointed_links))
    shares[0] = 1.0
    before, one, all_open = (view.draw(state, camera).astype(int) for state in (0.0, shares, 1.0))
    changed = [(np.abs(after - before).max(axis=-1) > 8).mean() for after in (one, all_open)]
    assert 0.002 < changed[0] < 0.7 * changed[1]


def test_the_object_stands_inside_the_picture(cabinet):
    """The ground surrounds it: nothing at the picture's edges depends on the object's joints."""
    view = ObjectView(cabinet)
    camera = view.camera((0.0, 1.0), OrbitView(160, 120))
    images = view._renderer.render(
        np.zeros((len(cabinet.links), 3)), np.tile((1.0, 0, 0, 0), (len(cabinet.links), 1)), [camera], ("geom",)
    )
    edges = [images.geom[0][0], images.geom[0][-1], images.geom[0][:, 0], images.geom[0][:, -1]]
    assert max(edge.max() for edge in edges) < 0


@pytest.mark.parametrize(
    ("fractions", "change", "message"),
    [
        (1.5, {}, r"\[0, 1\]"),
        ((0.0,), {}, r"has \d joints"),
        (0.0, {"elevation_deg": 91.0}, "elevation"),
        (0.0, {"height": 0}, "height"),
        (0.0, {"distance_m": -1.0}, "distance"),
    ],
)
def test_bad_arguments_are_named(cabinet, fractions, change, message):
    with pytest.raises(ConfigError, match=message):
        render_object(cabinet, fractions, replace(SMALL, **change))


def test_a_hung_cabinet_is_seen_from_behind_without_its_wall():
    hung = load_object("cabinet-0002")
    sides = [OrbitView(96, 72, azimuth_deg=azimuth) for azimuth in (0, 180)]
    behind, before = (render_object(hung, view=side) for side in sides)
    alone = replace(hung, links=tuple(hung.links[i] for i in hung.own_links))
    np.testing.assert_array_equal(behind, render_object(alone, view=sides[0]))
    assert behind.reshape(-1, 3).std(axis=0).min() > 10
    assert (before != render_object(alone, view=sides[1])).any()
