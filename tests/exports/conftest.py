"""A chair that has every kind of shape, joint and frame, and each category's first object of the catalogue."""

import numpy as np
import pytest

from artiskill.assets.articulated_object import (
    ArticulatedObject,
    CollisionShape,
    Joint,
    Link,
    Material,
    VisualMesh,
)
from artiskill.assets.kinematics import drawn_points, joint_values
from artiskill.geometry.meshes import TriMesh, merge
from artiskill.geometry.primitives import box, cylinder
from artiskill.geometry.rotations import quat_from_rpy

STILL = np.array((1.0, 0.0, 0.0, 0.0))
WHOLE_TURNS = (-np.inf, np.inf)


@pytest.fixture(scope="session")
def odd_chair() -> ArticulatedObject:
    """Turned and shifted frames, axes beside them, a rigid link, a spring, a joint without end, rest not at 0."""
    steel = Material("brushed steel", (0.4, 0.45, 0.5, 1.0), None, 0.6)
    checks = np.zeros((8, 4, 3), dtype=np.uint8) + 200
    checks[:4] = 90
    cloth = Material("cloth", (0.8, 0.1, 0.1, 1.0), checks, 0.0)
    glass = Material("glass", (0.9, 0.95, 1.0, 0.3), None, 0.9)
    corners = np.array([(x, y, z) for x in (-0.2, 0.2) for y in (-0.2, 0.2) for z in (-0.02, 0.03)], float)
    corners[:, 0] *= 1 + corners[:, 1]  # a trapezium
    seat = TriMesh(box((0.2, 0.2, 0.03)).vertices, box((0.2, 0.2, 0.03)).faces, np.full((8, 2), 0.5, np.float32))
    links = (
        _link(
            "base",
            -1,
            (0, 0, 0),
            STILL,
            None,
            [(cylinder(0.2, 0.02).transformed((0, 0, 0.1)), steel, "base")],
            [_shape("cylinder", (0.2, 0.02), (0, 0, 0.1))],
        ),
        _link(
            "lift",
            0,
            (0.01, 0.02, 0.3),
            quat_from_rpy((0.1, -0.2, 0.3)),
            Joint("lift_slide", "prismatic", np.array((0.0, 0.6, 0.8)), np.array((0.0, 0.0, 0.1)), (0.0, 0.12)),
            [(cylinder(0.03, 0.15), steel, "column")],
            [_shape("capsule", (0.03, 0.12), (0.0, 0.01, 0.0), quat_from_rpy((0.5, 0.4, 0.0)))],
        ),
        _link(
            "bracket",
            1,
            (0.0, 0.0, 0.16),
            quat_from_rpy((0.0, np.pi / 2, 0.4)),  # straight down: no unique roll and yaw
            None,
            [(box((0.05, 0.04, 0.01)), glass, "bracket")],
            [_shape("box", (0.05, 0.04, 0.01), (0.0, 0.0, 0.0))],
        ),
        _link(
            "seat",
            2,
            (0.02, 0.0, 0.05),
            quat_from_rpy((0.0, -np.pi / 2, 0.0)),
            Joint(
                "seat_tilt",
                "revolute",
                np.array((0.0, 1.0, 0.0)),
                np.array((0.1, 0.0, -0.05)),
                (-0.2, 0.3),
                40.0,
                -0.5,
            ),
            [(seat, cloth, "seat"), (box((0.02, 0.2, 0.2)).transformed((0.2, 0, 0.2)), cloth, "back")],
            [_shape("hull", (), (0, 0, 0), vertices=corners)],
        ),
        _link(
            "wheel",
            0,
            (0.15, 0.0, 0.04),
            STILL,
            Joint("wheel_roll", "revolute", np.array((0.0, 1.0, 0.0)), np.array((0.0, 0.01, 0.0)), WHOLE_TURNS),
            [(merge([cylinder(0.04, 0.01), box((0.01, 0.01, 0.02))]), steel, "wheel")],
            [_shape("sphere", (0.04,), (0, 0.01, 0), part="wheel")],
        ),
        # too small to weigh anything
        _link(
            "lever",
            3,
            (0.0, 0.2, 0.0),
            STILL,
            Joint("lever_pull", "prismatic", np.array((0.0, 1.0, 0.0)), np.zeros(3), (0.0, 0.02)),
            [(box((0.01, 0.03, 0.01)), steel, "lever")],
            [],
        ),
    )
    unmeasured = ArticulatedObject("odd-chair", "chair", links, (), np.zeros((2, 3)), {"source": "test"})
    points = drawn_points(unmeasured, joint_values(unmeasured, 0.0))
    bounds = np.stack((points.min(axis=0), points.max(axis=0)))
    return ArticulatedObject("odd-chair", "chair", links, (), bounds, {"source": "test"})


def _link(name, parent, position, quaternion, joint, visuals, shapes) -> Link:  # type: ignore[no-untyped-def]
    drawn = tuple(VisualMesh(*visual) for visual in visuals)
    place = np.array(position, dtype=float)
    return Link(name, parent, place, np.array(quaternion), joint, drawn, tuple(shapes), 500.0, np.zeros((0, 3)))


def _shape(kind, size, position, quaternion=STILL, vertices=None, part="") -> CollisionShape:  # type: ignore[no-untyped-def]
    return CollisionShape(kind, size, np.array(position, dtype=float), np.array(quaternion), vertices, part)
