from functools import cache

import numpy as np
import pytest

from artiskill.errors import UnknownNameError
from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.rotations import quat_from_axis_angle, quat_from_rpy, quat_multiply, quat_rotate
from artiskill.robots.arm_config import ArmConfig, ShapeConfig, load_arm
from artiskill.robots.config import load_robot
from artiskill.robots.visuals import ROBOT_PARTS, robot_visuals

ONE_ARMED = (*ROBOT_PARTS, "panda_finger")  # the finger is there twice
TRIANGLE_BUDGET = 4500


@cache
def arm() -> ArmConfig:
    return load_arm("panda")


def vertices(part: str) -> np.ndarray:
    return np.concatenate([v.mesh.vertices for v in robot_visuals(part)])


def components(mesh: TriMesh) -> list[np.ndarray]:
    """Faces of each connected piece."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    f, n = mesh.faces, len(mesh.vertices)
    pairs = np.concatenate((f[:, :2], f[:, 1:]))
    _, label = connected_components(coo_matrix((np.ones(len(pairs)), pairs.T), shape=(n, n)), directed=False)
    return [f[label[f[:, 0]] == k] for k in np.unique(label)]


def winding_number(mesh: TriMesh, points: np.ndarray) -> np.ndarray:
    """Sum of the solid angles of all faces over 4 pi: 1 inside, 0 outside (van Oosterom and Strackee, 1983)."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces][None] - points[:, None, None], 2, 0)
    la, lb, lc = (np.linalg.norm(x, axis=-1) for x in (a, b, c))
    dot_ab, dot_bc, dot_ca = (np.einsum("ijk,ijk->ij", p, q) for p, q in ((a, b), (b, c), (c, a)))
    above = np.einsum("ijk,ijk->ij", a, np.cross(b, c))
    return np.arctan2(above, la * lb * lc + dot_ab * lc + dot_bc * la + dot_ca * lb).sum(axis=1) / (2 * np.pi)


def outside_m(shape: ShapeConfig, points: np.ndarray) -> np.ndarray:
    """Signed distance from a capsule's, sphere's or box's surface."""
    inverse = quat_from_rpy(shape.rpy_rad) * (1, -1, -1, -1)
    local = quat_rotate(inverse, points - np.array(shape.position_m))
    if shape.kind in ("capsule", "sphere"):
        radius, half = (*shape.size, 0.0)[:2]
        local[:, 2] -= np.clip(local[:, 2], -half, half)
        return np.linalg.norm(local, axis=1) - radius
    assert shape.kind == "box"
    excess = np.abs(local) - shape.size
    return np.linalg.norm(np.maximum(excess, 0), axis=1) + np.minimum(excess.max(axis=1), 0)


@pytest.mark.parametrize("part", ROBOT_PARTS)
def test_every_piece_is_closed_and_faces_outwards(part):
    for visual in robot_visuals(part):
        for faces in components(visual.mesh):
            edges = np.concatenate([faces[:, [i, (i + 1) % 3]] for i in range(3)])
            unique, counts = np.unique(edges, axis=0, return_counts=True)
            directed = {(int(a), int(b)) for a, b in unique}
            assert counts.max() == 1, visual.part
            assert all((b, a) in directed for a, b in directed), visual.part
            a, b, c = (visual.mesh.vertices[faces[:, i]] for i in range(3))
            assert np.einsum("ij,ij->", a, np.cross(b, c)) > 1e-9, visual.part


@pytest.mark.parametrize("part", ROBOT_PARTS)
def test_finishes_are_opaque_and_parts_named_after_the_body(part):
    for visual in robot_visuals(part):
        assert visual.part.startswith(part)
        assert visual.material.rgba[3] == 1.0


def test_one_armed_robot_stays_within_the_triangle_budget():
    assert sum(len(v.mesh.faces) for part in ONE_ARMED for v in robot_visuals(part)) <= TRIANGLE_BUDGET


def test_pads_touch_when_closed_and_end_at_the_tip():
    pad = next(v.mesh for v in robot_visuals("panda_finger") if v.part == "panda_finger_black")
    assert pad.bounds[:, 0] == pytest.approx([-0.0085, 0.0085])
    assert pad.bounds[0, 1] == pytest.approx(0.0, abs=1e-12)
    assert pad.bounds[:, 2] == pytest.approx([0.0365, 0.0535])
    points = vertices("panda_finger")
    assert points[:, 1].min() == pytest.approx(0.0, abs=1e-12)
    assert points[:, 2].max() == pytest.approx(0.0535)


def test_fingers_stand_on_the_hand_at_both_ends_of_their_stroke():
    rail = next(v.mesh for v in robot_visuals("panda_hand") if v.part == "panda_hand_black").bounds
    foot = vertices("panda_finger")
    foot = foot[foot[:, 2] < 0.005] + (0, 0, 0.0584)
    assert foot[:, 2].min() <= rail[1, 2]
    for opening_m in arm().finger.range_m:
        assert foot[:, 1].min() + opening_m > 0
        assert foot[:, 1].max() + opening_m < rail[1, 1]


@pytest.mark.parametrize(
    ("part", "low", "high"),
    [
        ("mobile_base", (-0.26, -0.21, 0.0), (0.26, 0.21, 0.12)),
        ("lift", (-0.15, -0.10, -1.6), (0.15, 0.10, 0.0)),
        ("panda_hand", (-0.036, -0.1, 0.0), (0.036, 0.1, 0.067)),
    ],
)
def test_parts_keep_to_their_boxes(part, low, high):
    points = vertices(part)
    assert np.all(points.min(axis=0) >= np.array(low) - 1e-9)
    assert np.all(points.max(axis=0) <= np.array(high) + 1e-9)


def test_torso_reaches_from_the_lift_to_both_arms():
    points = vertices("torso")
    assert points[:, 2].min() == pytest.approx(-0.1315)
    # where link 1's flange begins, the axle's ends must be, on the axis of joint 1 at |y| = 0.3012
    flange = vertices("panda_link1")[:, 2].min() + 0.3012
    for side in (-1, 1):
        end = points[side * points[:, 1] > flange - 0.002]
        assert side * end[:, 1].mean() == pytest.approx(flange, abs=0.002)
        assert end[:, [0, 2]].mean(axis=0) == pytest.approx([0.08083, 0.2885], abs=1e-6)
        assert np.linalg.norm(end[:, [0, 2]] - (0.08083, 0.2885), axis=1).max() < 0.07


@pytest.mark.parametrize("index", range(7))
def test_arm_follows_its_collision_shapes(index):
    """The joint barrels stand out sideways, as the real arm's do; nothing else of an arm link does by much."""
    link = arm().links[index]
    points = vertices(link.name)
    outside = np.min([outside_m(shape, points) for shape in link.collisions], axis=0)
    assert outside.max() < 0.017
    assert np.median(outside) < 0.03


@pytest.mark.parametrize("index", range(1, 7))
def test_neighbouring_shells_stay_out_of_each_other_over_the_joint_range(index):
    joint = arm().joints[index]
    parent, child = (_shell(arm().links[k].name) for k in (index - 1, index))
    for angle in np.linspace(*joint.range_rad, 7):
        turn = quat_multiply(quat_from_rpy(joint.rpy_rad), quat_from_axis_angle((0, 0, 1), angle))
        moved = child.transformed(joint.position_m, turn)
        inside = np.concatenate(
            (winding_number(parent, moved.vertices) > 0.5, winding_number(moved, parent.vertices) > 0.5)
        )
        assert inside.mean() < 0.02, f"{joint.name} at {angle:.2f}"


@pytest.mark.parametrize("index", range(1, 7))
def test_no_gap_between_neighbours(index):
    """The next link's shell or collar comes as near as the seam is wide, at any angle."""
    joint = arm().joints[index]
    parent = vertices(arm().links[index - 1].name)
    child = vertices(arm().links[index].name)
    for angle in np.linspace(*joint.range_rad, 3):
        turn = quat_multiply(quat_from_rpy(joint.rpy_rad), quat_from_axis_angle((0, 0, 1), angle))
        moved = quat_rotate(turn, child) + np.array(joint.position_m)
        assert np.linalg.norm(parent[:, None] - moved[None], axis=-1).min() < 0.015


def test_unknown_part_names_the_nearest():
    with pytest.raises(UnknownNameError, match="panda_link7"):
        robot_visuals("panda_link8")


def _shell(part: str) -> TriMesh:
    return next(v.mesh for v in robot_visuals(part) if v.part == f"{part}_white")


@pytest.mark.parametrize("part", ["mobile_base", "lift", "torso"])
def test_trunk_is_covered_by_its_collision_shapes(part):
    """What a hand could reach into is solid; the visor and the shoulders' caps may stand out a little."""
    robot = load_robot("one_arm")
    shapes = {"mobile_base": robot.base, "lift": robot.lift, "torso": robot.torso}[part].collisions
    outside = np.min([outside_m(shape, vertices(part)) for shape in shapes], axis=0)
    assert outside.max() < 0.025
