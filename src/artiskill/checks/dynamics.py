"""Checks in the simulation: joints can be driven, objects stand still, chairs roll, buckets hold a ball."""

import math
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, Joint
from artiskill.checks.config import DriveConfig, PushConfig
from artiskill.checks.context import FREE, CheckContext, CheckResult, at_least, at_most, fine
from artiskill.geometry.rotations import quat_conjugate, quat_rotate
from artiskill.scene.object_model import ObjectScene, build_object_scene, object_spec, resolve_object_scene
from artiskill.scene.physics import Group, set_contact

_DRIVE_STEPS = 20  # from one look at driven joints to the next
_WATCH_STEPS = 10  # from one look at a free object to the next
_FALLEN_RAD = math.radians(45)
_UPRIGHT = 0.9  # a seat's swivel axis is this nearly vertical: the cosine of 26 degrees
_BALL = "ball"
# sides of the middle on which balls are dropped; off the middle a ball moves on towards the wall
_BALL_SIDES = {
    (0, 0): "in the middle",
    (1, 0): "towards +x",
    (0, 1): "towards +y",
    (-1, 0): "towards -x",
    (0, -1): "towards -y",
}


def check_drive(context: CheckContext) -> list[CheckResult]:
    """Check that a limited force takes every joint from one limit to the other and back.

    One result per joint: the share of its range, or of a turn, that it covered, the worse of both ways. Friction
    and damping are the highest that the category's tasks draw. The root is held; gravity and springs are balanced,
    for how hard they make it is the object's character. A joint that is too heavy, or has limits or an axis with
    which the engine cannot do anything, does not get there. Links do not meet one another here, as they do not in
    the benchmark: `check_sweep` looks at that.
    """
    joints, drive = context.joints, context.config.drive
    if not joints:
        return []
    scene = build_object_scene(context.object, context.physics, ground=False, hold=True)
    model = context.model_with(context.limits.joints, context.limits.wheels, scene)
    model.opt.gravity[:] = 0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_SPRING)
    slides = np.array([joint.kind == "prismatic" for joint in joints])
    forces = np.where(context.on_wheels, drive.wheel_torque_nm, np.where(slides, drive.force_n, drive.torque_nm))
    data = scene.rest_data()
    start = data.qpos[scene.qpos].copy()
    limited = np.array([all(map(math.isfinite, joint.limits)) for joint in joints])
    low = np.array([j.limits[0] if math.isfinite(j.limits[0]) else q for j, q in zip(joints, start, strict=True)])
    spans = np.array(
        [j.limits[1] - j.limits[0] if x else 2 * math.pi for j, x in zip(joints, limited, strict=True)]
    )
    top = _drive(model, data, scene, drive, forces, low, spans)
    high = np.where(limited, low + spans, top)
    bottom = _drive(model, data, scene, drive, forces, high, -spans)
    shares = np.minimum((top - low) / spans, (high - bottom) / spans).tolist()
    results = []
    for joint, share, force, a, b in zip(joints, shares, forces, bottom, top, strict=True):
        note = "" if share >= drive.reach else _drive_note(joint, force, a, b, drive)
        results.append(at_least(joint.name, 100 * min(share, 1.0), 100 * drive.reach, "%", note))
    return results


def _drive(
    model: Any,
    data: Any,
    scene: ObjectScene,
    drive: DriveConfig,
    forces: np.ndarray,
    begin: np.ndarray,
    way: np.ndarray,
) -> np.ndarray:
    """Move all joints by `way` from `begin` until all are there or time is up; return furthest values, (J,)."""
    data.qfrc_applied[scene.dofs] = np.sign(way) * forces
    reached = np.zeros(len(way))
    for _ in range(math.ceil(drive.time_s / (model.opt.timestep * _DRIVE_STEPS))):
        mujoco.mj_step(model, data, _DRIVE_STEPS)
        reached = np.maximum(reached, (data.qpos[scene.qpos] - begin) / way)
        if (reached >= 0.5 * (1 + drive.reach)).all() or not np.isfinite(reached).all():
            break
    return begin + reached * way


def _drive_note(joint: Joint, force: float, bottom: float, top: float, drive: DriveConfig) -> str:
    force_unit, unit = ("N", "m") if joint.kind == "prismatic" else ("N m", "rad")
    low, high = joint.limits
    return (
        f"{force:g} {force_unit} moved it between {bottom:.3f} and {top:.3f} {unit} only "
        f"(range {low:.3f} to {high:.3f}) in {drive.time_s:g} s each way"
    )


@dataclass(frozen=True, eq=False)
class RootMotion:
    """How a free root moved.

    Attributes:
        moved: (3,) m, from its first place to where it was at the end.
        moved_xy_m: its largest distance from its first place, in the plane.
        tilt_rad: how far its z axis leaned at most.
    """

    moved: np.ndarray
    moved_xy_m: float
    tilt_rad: float


def _watch(model: Any, data: Any, time_s: float) -> RootMotion:
    """Step for so long and record what the free root, which stands first in qpos, does.

    What falls over is not watched any further; a simulation that diverges counts as fallen over.
    """
    first = data.qpos[:3].copy()
    furthest_m = tilt_rad = 0.0
    for _ in range(math.ceil(time_s / (model.opt.timestep * _WATCH_STEPS))):
        mujoco.mj_step(model, data, _WATCH_STEPS)
        furthest_m = max(furthest_m, float(np.linalg.norm(data.qpos[:2] - first[:2])))
        tilt_rad = max(tilt_rad, math.pi if _diverged(data) else _tilt_of(data.qpos[3:7]))
        if tilt_rad > _FALLEN_RAD:
            break
    return RootMotion(data.qpos[:3] - first, furthest_m, tilt_rad)


def _diverged(data: Any) -> bool:
    """Return whether the engine met numbers with which it cannot go on, and began anew."""
    kinds = mujoco.mjtWarning
    bad = (kinds.mjWARN_BADQPOS, kinds.mjWARN_BADQVEL, kinds.mjWARN_BADQACC)
    return any(data.warning[int(kind)].number for kind in bad)


def _tilt_of(quaternion: np.ndarray) -> float:
    """Return the angle between a body's z axis and the vertical."""
    _, x, y, _ = quaternion.tolist()
    return math.acos(max(-1.0, min(1.0, 1 - 2 * (x * x + y * y))))


def check_settle(context: CheckContext) -> list[CheckResult]:
    """Check drift and lean of an object that is set down at rest, without friction or damping in any joint."""
    settle = context.config.settle
    motion = _watch(context.model_with(), context.scene.rest_data(), settle.time_s)
    along, up = 1e3 * float(np.linalg.norm(motion.moved[:2])), 1e3 * float(motion.moved[2])
    where = (
        f"in {settle.time_s:g} s: {along:.1f} mm along the ground, {abs(up):.1f} mm {'down' if up < 0 else 'up'}"
    )
    drift, lean = 1e3 * float(np.linalg.norm(motion.moved)), math.degrees(motion.tilt_rad)
    return [
        at_most("drift", drift, settle.drift_m * 1e3, "mm", where),
        at_most("lean", lean, settle.tilt_deg, "deg", f"in {settle.time_s:g} s"),
    ]


def check_roll(context: CheckContext) -> list[CheckResult]:
    """Check that plausible pushes roll a chair and do not tip it: shortest way and greatest lean over all sides.

    Wheels turn freely: whether the chair can roll is a question of its shape and mass. The task draws how hard a
    level makes it.
    """
    scene, push = context.scene, context.config.push
    weight = float(scene.model.body_subtreemass[scene.bodies[0]]) * abs(float(scene.model.opt.gravity[2]))
    force, height = min(push.force_n, push.weight_share * weight), _push_height(context.object, push)
    angles = [2 * math.pi * k / push.directions for k in range(push.directions)]
    motions = [
        _pushed(context, force * np.array((math.cos(angle), math.sin(angle), 0.0)), height) for angle in angles
    ]
    ways, leans = [m.moved_xy_m for m in motions], [math.degrees(m.tilt_rad) for m in motions]
    short, lean = int(np.argmin(ways)), int(np.argmax(leans))
    how = f"{force:.0f} N for {push.time_s:g} s at {height:.2f} m, towards"
    return [
        at_least("way", ways[short], push.distance_m, "m", f"{how} {360 * short // push.directions} deg"),
        at_most("lean", leans[lean], push.tilt_deg, "deg", f"{how} {360 * lean // push.directions} deg"),
    ]


def _push_height(obj: ArticulatedObject, push: PushConfig) -> float:
    """Return the height of the seat, as far as it is known."""
    height = obj.metadata.get("seat_height_m")
    bottom, top = (float(z) for z in np.asarray(obj.bounds)[:, 2])
    return float(height) if height is not None else bottom + push.height_share * (top - bottom)


def _pushed(context: CheckContext, force: np.ndarray, height_m: float) -> RootMotion:
    """Push the root at a height above the ground, over its centre of mass, and let it coast."""
    push, model, data = context.config.push, context.model_with(), context.scene.rest_data()
    root = int(context.scene.bodies[0])
    arm = np.array((0.0, 0.0, height_m - float(data.xipos[root, 2])))
    data.xfrc_applied[root, :3] = force
    data.xfrc_applied[root, 3:] = np.cross(arm, force)
    during = _watch(model, data, push.time_s)
    data.xfrc_applied[:] = 0
    after = _watch(model, data, push.coast_s)
    moved = during.moved + after.moved
    furthest_m = max(during.moved_xy_m, float(np.linalg.norm(moved[:2])))
    return RootMotion(moved, furthest_m, max(during.tilt_rad, after.tilt_rad))


def check_swivel(context: CheckContext) -> list[CheckResult]:
    """Check how far a torque about the vertical turns the seat against the base.

    Friction and damping are the highest that the task draws. With wheels as stiff as they get, the base stays.
    """
    push, joint, scene = context.config.push, _swivel_joint(context), context.scene
    if joint is None:
        return [fine("object", "its seat has no swivel")]
    model, data = context.model_with(context.limits.joints, context.limits.wheels), scene.rest_data()
    address, body = scene.qpos[joint], int(scene.model.jnt_bodyid[scene.joints[joint]])
    first = float(data.qpos[address])
    data.xfrc_applied[body, 5] = push.torque_nm
    mujoco.mj_step(model, data, math.ceil(push.time_s / model.opt.timestep))
    turned = math.degrees(abs(float(data.qpos[address]) - first))
    note = f"{push.torque_nm:g} N m for {push.time_s:g} s"
    return [at_least(context.joints[joint].name, turned, push.swivel_deg, "deg", note)]


def _swivel_joint(context: CheckContext) -> int | None:
    """Return the joint that turns about the vertical and carries most, casters left out; None if there is none."""
    found: tuple[float, int] | None = None
    scene = context.scene
    for k, joint in enumerate(context.joints):
        upright = joint.kind == "revolute" and abs(float(joint.axis[2])) > _UPRIGHT
        if upright and not context.on_wheels[k]:
            mass = float(scene.model.body_subtreemass[scene.model.jnt_bodyid[scene.joints[k]]])
            found = max(found or (0.0, k), (mass, k))
    return None if found is None else found[1]


def check_ball(context: CheckContext) -> list[CheckResult]:
    """Check that balls, dropped one at a time into a bucket, end up inside the root's bounds."""
    scene = _scene_with_ball(context)
    visuals = context.object.links[0].visuals
    corners = np.concatenate([visual.mesh.bounds for visual in visuals])
    highest = max(visuals, key=lambda visual: float(visual.mesh.bounds[1, 2])).part
    bounds = np.stack((corners.min(axis=0), corners.max(axis=0)))  # (2, 3) of what is drawn of the root
    outside = []
    for side, name in _BALL_SIDES.items():
        place = _drop_ball(context, scene, bounds, np.array(side, dtype=float))
        if not ((place >= bounds[0]) & (place <= bounds[1])).all():
            outside.append(f"the one dropped {name} lies at {np.round(place, 2).tolist()}")
    body = f"outside of the body {np.round(bounds, 2).tolist()}, whose top is that of {highest!r}"
    note = f"{body}: {'; '.join(outside)}" if outside else ""
    return [at_least("object", len(_BALL_SIDES) - len(outside), len(_BALL_SIDES), "", note)]


def _scene_with_ball(context: CheckContext) -> ObjectScene:
    """Compile the object on the ground, its root first in qpos, and a free ball, last."""
    physics, ball = context.physics, context.config.ball
    spec, part = object_spec(context.object, physics)
    body = spec.worldbody.add_body(name=_BALL)
    body.add_freejoint(name=_BALL)
    geom = body.add_geom(name=_BALL, type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(ball.radius_m, 0, 0))
    geom.density = ball.density_kg_m3
    set_contact(geom, Group.LOOSE, Group.OBJECT | Group.GROUND, physics.contact.object_friction, physics)
    return resolve_object_scene(spec.compile(), context.object, part)


def _drop_ball(context: CheckContext, scene: ObjectScene, bounds: np.ndarray, side: np.ndarray) -> np.ndarray:
    """Drop a ball on that side of the middle; return where it ends up in the root's frame, (3,)."""
    ball = context.config.ball
    model = context.model_with(context.limits.joints, FREE, scene)
    data = scene.rest_data()
    middle, half = bounds.mean(axis=0), np.diff(bounds, axis=0)[0] / 2
    free = np.maximum(half[:2] - ball.radius_m, 0.0)
    root = data.qpos[:3].copy()
    data.qpos[-7:-5] = root[:2] + middle[:2] + ball.offset * free * side
    data.qpos[-5] = root[2] + bounds[1, 2] + ball.drop_m
    data.qvel[-6:-4] = ball.speed_m_s * side
    mujoco.mj_step(model, data, round(ball.time_s / model.opt.timestep))
    return quat_rotate(quat_conjugate(data.qpos[3:7]), data.qpos[-7:-4] - data.qpos[:3])
