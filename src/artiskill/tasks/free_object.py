"""What tasks with free objects share: pose and motion of the object, distance of the hands, observation, masks."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.config import check_not_negative, check_positive
from artiskill.geometry.arrays import Array, arccos, clip, dot, namespace, norm, rotate, total
from artiskill.geometry.kernel import allocating_kernel
from artiskill.geometry.meshes import sample_surface, triangle_areas
from artiskill.scene.scene import Scene
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.staged_reward import Ramp, Stage
from artiskill.tasks.state_vector import (
    FAR_M,
    FAST,
    ObservationField,
    along_base_axes,
    base_position,
    joint_fields,
    object_size,
    observe_state,
    side_by_side,
    state_fields,
)

# The last stage begins a little nearer than near: an object that arrives slowly, and so counts as still, would
# otherwise skip the stage before it.
SAFELY_NEAR = 0.95
MASK_NAMES = ("robot",)
SURFACE_POINTS = 800  # on a chair, some 4 cm apart
_CACHED_OBJECTS = 256


@dataclass(frozen=True)
class StandingConfig:
    """When an object counts as standing still at its target.

    Attributes:
        near_m: greatest distance of its root from the target, in the plane.
        max_tilt_rad: greatest angle of its z axis with the vertical.
        max_speed_m_s: of its root, for it to count as still.
        max_angular_speed_rad_s: of its root, for it to count as still.
        hold_s: how long each condition must hold before it counts.
    """

    near_m: float
    max_tilt_rad: float
    max_speed_m_s: float
    max_angular_speed_rad_s: float
    hold_s: float

    def __post_init__(self) -> None:
        check_positive(self, "near_m", "max_tilt_rad", "max_speed_m_s", "max_angular_speed_rad_s")
        check_not_negative(self, "hold_s")


@dataclass(frozen=True)
class FreeObjectStateConfig:
    """What the state vector says.

    Attributes:
        relative: where target, object and hands are and how they move, as the robot's base sees them, in place of
            the paper's numbers: see `relative_fields`.
    """

    relative: bool = False


def arrival_stages(braking: str, arrived: str, asks: tuple[str, ...]) -> tuple[Stage, Stage]:
    """Return the last two stages of a task that brings an object somewhere: near; and near, upright and still."""
    braking_ends = (
        Ramp("speed", 3.0, 1.0),
        Ramp("angular_speed", 3.0, 1.0),
        Ramp("lean", 2.0, 1.0),
        Ramp("near", 1.0, SAFELY_NEAR),
    )
    inside = (
        Ramp("speed", 1.0, 0.8),
        Ramp("angular_speed", 1.0, 0.8),
        Ramp("lean", 1.0, 0.8),
        Ramp("near", SAFELY_NEAR, 0.9),
    )
    return (
        Stage(braking, asks, enters=(Ramp("near", 1.0, SAFELY_NEAR),), leaves=braking_ends),
        Stage(arrived, asks, enters=inside),
    )


@dataclass(frozen=True, eq=False)
class ObjectPose:
    """How an object stands and moves, measured once per snapshot: all (B,)."""

    snapshot: Snapshot

    @cached_property
    def distance_m(self) -> Array:
        """From the origin, where the target is, in the plane."""
        return norm(self.snapshot.link_position_w[:, 0, :2])

    @cached_property
    def tilt_rad(self) -> Array:
        """Angle of the root's z axis with the vertical, 0 to pi."""
        return arccos(clip(self.snapshot.link_rotation_w[:, 0, 2, 2], -1.0, 1.0))

    @cached_property
    def speed_m_s(self) -> Array:
        """Of the root, over the last step."""
        return self.snapshot.link_speed_m_s[:, 0]

    @cached_property
    def angular_speed_rad_s(self) -> Array:
        """Of the root, over the last step."""
        return self.snapshot.link_angular_speed_rad_s[:, 0]

    @cached_property
    def approach_speed_m_s(self) -> Array:
        """How fast the root nears the target, in the plane; negative away from it."""
        xp = namespace(self.snapshot.link_position_w)
        position = self.snapshot.link_position_w[:, 0, :2]
        toward = dot(position, self.snapshot.root_velocity_w[:, :2])
        return -toward / xp.maximum(self.distance_m, xp.asarray(1e-6, dtype=position.dtype))

    def arrival(self, config: StandingConfig) -> dict[str, Array]:
        """Return four measures, each (B,), relative to what counts as near, upright and still."""
        return {
            "near": self.distance_m / config.near_m,
            "lean": self.tilt_rad / config.max_tilt_rad,
            "speed": self.speed_m_s / config.max_speed_m_s,
            "angular_speed": self.angular_speed_rad_s / config.max_angular_speed_rad_s,
        }

    def near(self, config: StandingConfig) -> Array:
        """Return whether it is near its target, (B,) bool."""
        return self.distance_m <= config.near_m

    def upright(self, config: StandingConfig) -> Array:
        """Return whether it stands upright, (B,) bool."""
        return self.tilt_rad <= config.max_tilt_rad

    def still(self, config: StandingConfig) -> Array:
        """Return whether it stands still, (B,) bool."""
        slow = self.speed_m_s <= config.max_speed_m_s
        return slow & (self.angular_speed_rad_s <= config.max_angular_speed_rad_s)


def free_object_fields(
    max_joints: int,
    arms: int,
    props: tuple[str, ...] = (),
    state: FreeObjectStateConfig = FreeObjectStateConfig(),
) -> tuple[ObservationField, ...]:
    """Return what the numbers of the state vector are, in order; `props` are the free ones."""
    if state.relative:
        return relative_fields(arms, props)
    extra = tuple(
        ObservationField(f"{name} {what}, world frame", 3, bound, unit)
        for name in props
        for what, bound, unit in (("position", FAR_M, "m"), ("velocity", FAST, "m/s"))
    )
    return state_fields(max_joints, arms, extra)


def relative_fields(arms: int, props: tuple[str, ...] = ()) -> tuple[ObservationField, ...]:
    """Return what the numbers of `observe_relative` are.

    Joints of the object are not among them. What of it hands can touch is in the ways to its nearest points, and
    casters and wheels, most of a chair's joints, turn without end.
    """
    return (
        ObservationField("target position, base frame", 3, FAR_M, "m"),
        ObservationField("object root position, base frame", 3, FAR_M, "m"),
        ObservationField("object's x and z axis, base frame", 6, 1.0, "1"),
        ObservationField("object root linear velocity, base frame", 3, FAST, "m/s"),
        ObservationField("object root angular velocity, base frame", 3, FAST, "rad/s"),
        *(ObservationField(f"{name} position, base frame", 3, FAR_M, "m") for name in props),
        *(ObservationField(f"{name} velocity, base frame", 3, FAST, "m/s") for name in props),
        ObservationField("from fingertips to the nearest points of the object, base frame", 6 * arms, FAR_M, "m"),
        ObservationField("where hands point and where their fingers close, base frame", 6 * arms, 1.0, "1"),
        ObservationField("fingertip velocities, base frame", 6 * arms, FAST, "m/s"),
        ObservationField("base velocity x, y, base frame", 2, FAST, "m/s"),
        ObservationField("base yaw rate", 1, FAST, "rad/s"),
        *joint_fields(arms),
    )


def observe_free_object(
    snapshot: Snapshot,
    goal: "SurfaceGoal",
    max_joints: int,
    state: FreeObjectStateConfig = FreeObjectStateConfig(),
) -> Array:
    """Return the state vector, (B, D) float32, of `free_object_fields`. The goal is at the origin.

    Raises:
        AssetError: the object has more joints than the paper's vector has slots.
    """
    if state.relative:
        return observe_relative(snapshot, goal)
    props, start = snapshot.prop_position_w.shape[1], object_size(max_joints)
    values = observe_state(snapshot, max_joints, 6 * props)
    for k in range(props):
        values[:, start : start + 3] = snapshot.prop_position_w[:, k]
        values[:, start + 3 : start + 6] = snapshot.prop_velocity_w[:, k]
        start += 6
    return values


def observe_relative(snapshot: Snapshot, goal: "SurfaceGoal") -> Array:
    """Return the numbers of `relative_fields`, (B, D) float32.

    They are along the axes of the robot's base, for what the robot has to do does not depend on where it stands.
    Positions are from its place on the ground, velocities those in the world.
    """
    xp, qpos, qvel = namespace(snapshot.robot_qpos), snapshot.robot_qpos, snapshot.robot_qvel
    place, axes = snapshot.link_position_w[:, :1], snapshot.link_rotation_w[:, 0]
    tools = snapshot.tool_rotation_w
    base = base_position(snapshot)[:, None]
    vectors = (
        -base,
        place - base,
        axes[:, None, :, 0],
        axes[:, None, :, 2],
        xp.reshape(snapshot.root_velocity_w, (-1, 2, 3)),
        snapshot.prop_position_w - base,
        snapshot.prop_velocity_w,
        fingertip_gaps(snapshot, goal),
        tools[..., 2],
        tools[..., 1],
        snapshot.fingertip_velocity_w,
        qvel[:, None, :3],  # x, y, and the yaw rate, which no turn of the base changes
    )
    return side_by_side((along_base_axes(snapshot, xp.concat(vectors, axis=1)), qpos[:, 3:], qvel[:, 3:]))


def describe_distance(snapshot: Snapshot, goal: object) -> str:
    """Return how far the object of one episode is from its goal."""
    return f"{ObjectPose(snapshot).distance_m[0]:.2f} m from its goal"


def robot_mask(scene: Scene, target: str) -> np.ndarray:
    """Return which of `Scene.visuals` belong to the robot, (1, G) bool: the object is not told apart."""
    robot_bodies = [scene.model.body(name).id for name in scene.robot.bodies]
    return np.isin([body for body, _ in scene.visuals], robot_bodies)[None]


@lru_cache(maxsize=_CACHED_OBJECTS)
def surface_samples(obj: ArticulatedObject) -> tuple[np.ndarray, np.ndarray]:
    """Return points spread over everything drawn of an object, the same ones every time.

    Returns:
        (P, 3) in the frame of their link, and (P,) the index of that link.
    """
    rng = np.random.default_rng(0)  # fixed: the points are a property of the object
    areas = np.array([total(float(triangle_areas(v.mesh).sum()) for v in link.visuals) for link in obj.links])
    ends = np.round(np.cumsum(areas / areas.sum()) * SURFACE_POINTS).astype(int)
    counts = np.diff(ends, prepend=0)
    points = [
        sample_surface([v.mesh for v in link.visuals], count, rng)
        for link, count in zip(obj.links, counts, strict=True)
        if count
    ]
    return np.concatenate(points), np.repeat(np.arange(len(obj.links)), counts)


@dataclass(frozen=True, eq=False)
class SurfaceGoal:
    """What goals have where any part of the object may be touched.

    Attributes:
        row: (B,) 0 to B - 1.
        points: (B, P, 3) samples of the object's surface, in the frame of their link.
        point_link: (B, P) index of that link.
    """

    row: Array
    points: Array
    point_link: Array


def fingertip_distance(snapshot: Snapshot, goal: SurfaceGoal) -> Array:
    """Return the mean distance of the fingertips to the nearest of the surface's points, (B,) in metres."""
    if isinstance(snapshot.fingertip_position_w, np.ndarray):
        return _nearest(snapshot, goal)[1]
    xp, gaps = namespace(snapshot.fingertip_position_w), fingertip_gaps(snapshot, goal)
    return xp.mean(xp.sqrt(dot(gaps, gaps)), axis=-1)


def fingertip_gaps(snapshot: Snapshot, goal: SurfaceGoal) -> Array:
    """Return the ways from the fingertips to the nearest of the surface's points, (B, T, 3) in the world."""
    if isinstance(snapshot.fingertip_position_w, np.ndarray):
        return _nearest(snapshot, goal)[0]
    return fingertip_gaps_reference(snapshot, goal)


def fingertip_gaps_reference(snapshot: Snapshot, goal: SurfaceGoal) -> Array:
    """Return `fingertip_gaps` for any array library: the kernel's definition."""
    tips, xp = snapshot.fingertip_position_w, namespace(snapshot.fingertip_position_w)
    at = rows, _ = goal.row[:, None], goal.point_link
    in_world = rotate(snapshot.link_rotation_w[at], goal.points) + snapshot.link_position_w[at]  # (B, P, 3)
    gaps = in_world[:, None] - tips[:, :, None]  # (B, T, P, 3)
    nearest = xp.argmin(dot(gaps, gaps), axis=-1)  # (B, T)
    return gaps[rows, xp.arange(tips.shape[1])[None], nearest]


def _nearest(snapshot: Snapshot, goal: SurfaceGoal) -> tuple[np.ndarray, np.ndarray]:
    """Return `fingertip_gaps` and `fingertip_distance`."""
    tips = np.ascontiguousarray(snapshot.fingertip_position_w)
    gaps, distance = (
        np.full(tips.shape, np.nan),
        np.empty(len(tips)),
    )  # no point is near where poses are no numbers
    links = snapshot.link_position_w, snapshot.link_rotation_w
    _nearest_kernel(tips, *links, goal.points, goal.point_link, gaps, distance)
    return gaps, distance


@allocating_kernel
def _nearest_kernel(
    tips: Any, position_w: Any, rotation_w: Any, points: Any, link: Any, gaps: Any, distance: Any
) -> None:
    """Fill `gaps` (B, T, 3) and `distance` (B,); the goal has `points` (B, P, 3) and their `link` (B, P)."""
    count = tips.shape[1]
    nearest = np.empty(count)
    for b in range(tips.shape[0]):
        nearest[:] = np.inf
        for p in range(points.shape[1]):
            k = link[b, p]
            x, y, z = points[b, p, 0], points[b, p, 1], points[b, p, 2]
            turn, origin = rotation_w[b, k], position_w[b, k]
            world_x = turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z + origin[0]
            world_y = turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z + origin[1]
            world_z = turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z + origin[2]
            for t in range(count):
                dx, dy, dz = world_x - tips[b, t, 0], world_y - tips[b, t, 1], world_z - tips[b, t, 2]
                squared = dx * dx + dy * dy + dz * dz
                if squared < nearest[t]:
                    nearest[t] = squared
                    gaps[b, t, 0], gaps[b, t, 1], gaps[b, t, 2] = dx, dy, dz
        summed = 0.0
        for t in range(count):
            summed += np.sqrt(nearest[t])
        distance[b] = summed / count


def load_kernel() -> None:
    """Compile the kernel, or read it from the disk's cache, now: no reset or step has to wait for it later."""
    one, link = np.ones((1, 1, 3)), np.zeros((1, 1), dtype=np.int64)
    _nearest_kernel(one, one, np.ones((1, 1, 3, 3)), one, link, np.empty((1, 1, 3)), np.empty(1))
