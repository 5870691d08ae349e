"""Every handle can be gripped by the real gripper, or hooked, and is within the arm's reach.

Gripped: in one of the handle's grasp poses the open gripper is free, and when its fingers close, both pads meet
the handle. Hooked, for handles that say so: the tips of the closed fingers fit behind it from some side, and the
handle stops them when they are pulled away. The object is at rest, the ground is there. The bail of a bucket,
which lies against its wall at rest, may be taken half way up instead.
"""

import numpy as np

from artiskill.assets.articulated_object import Handle
from artiskill.assets.kinematics import joint_values, link_poses
from artiskill.checks.config import ChecksConfig, GripConfig
from artiskill.checks.gripper import GripperProbe
from artiskill.checks.grips import PlacedHandle, place_handle, try_grasps, try_hook
from artiskill.checks.result import CheckResult, at_most, failed, fine
from artiskill.checks.specimen import Specimen
from artiskill.robots.arm_config import load_arm
from artiskill.robots.config import load_robot

GRIP, REACH = "handles", "reach"


def check_handles(specimen: Specimen, config: ChecksConfig) -> list[CheckResult]:
    """One result per handle."""
    obj = specimen.object
    if not obj.handles:
        return [fine(GRIP, "object", "it has no handles")]
    probe = GripperProbe(obj, load_arm(load_robot(config.grip.robot).arm))
    found: dict[str, CheckResult] = {}
    for qpos, when in _states(specimen):
        probe.set_joints(qpos)
        for placed in _placed(specimen, qpos):
            subject = _subject(placed.handle, obj.handles)
            if subject not in found or not found[subject].passed:
                found[subject] = _judge(probe, placed, config.grip, specimen, subject, when)
    return list(found.values())


def _states(specimen: Specimen) -> list[tuple[np.ndarray, str]]:
    """Joint values in which handles may be taken, and what to say of them."""
    states = [(specimen.rest, "")]
    if specimen.object.category == "bucket" and specimen.joints:
        states.append((joint_values(specimen.object, 0.5), ", half way up"))
    return states


def check_reach(specimen: Specimen, config: ChecksConfig) -> list[CheckResult]:
    """How far the arm's first joint is from the handle that is hardest to reach, the lift at its best height."""
    obj, grip = specimen.object, config.grip
    if not obj.handles:
        return [fine(REACH, "object", "it has no handles")]
    robot = load_robot(grip.robot)
    mount = robot.torso.position_m[2] + robot.mounts[0].position_m[2]
    low, high = (mount + lift for lift in robot.lift.range_m)
    results = []
    for placed in _placed(specimen, specimen.rest):
        height = float(placed.grasps[0][0][2])
        distance = float(np.hypot(max(low - height, height - high, 0.0), grip.stand_off_m))
        note = f"{height:.2f} m above the ground, {grip.stand_off_m:g} m in front of it"
        results.append(at_most(REACH, _subject(placed.handle, obj.handles), distance, grip.reach_m, "m", note))
    return [max(results, key=lambda result: result.value or 0.0)]


def _judge(
    probe: GripperProbe, placed: PlacedHandle, config: GripConfig, specimen: Specimen, subject: str, when: str
) -> CheckResult:
    attempt = try_grasps(probe, placed, config, [link.name for link in specimen.object.links])
    depth, limit = 1e3 * attempt.depth_m, 1e3 * config.penetration_m
    if attempt.gripped:
        return at_most(GRIP, subject, depth, limit, "mm", f"gripped {1e3 * attempt.width_m:.0f} mm wide{when}")
    if not placed.handle.hookable:
        return failed(
            GRIP, subject, f"not gripped: {attempt.problem}{when}; it does not say that it can be hooked"
        )
    side = try_hook(probe, placed, config)
    if side:
        return fine(GRIP, subject, f"hooked from {side}{when}; not gripped: {attempt.problem}")
    return failed(
        GRIP, subject, f"not gripped: {attempt.problem}{when}; not hooked: no place behind it from any side"
    )


def _placed(specimen: Specimen, qpos: np.ndarray) -> list[PlacedHandle]:
    obj = specimen.object
    positions, quaternions = link_poses(obj, qpos)
    return [place_handle(obj, handle, positions, quaternions) for handle in obj.handles]


def _subject(handle: Handle, handles: tuple[Handle, ...]) -> str:
    """The link's name and what the handle is; numbered where that is not enough."""
    alike = [h for h in handles if (h.link, h.kind) == (handle.link, handle.kind)]
    number = f" {1 + next(i for i, h in enumerate(alike) if h is handle)}" if len(alike) > 1 else ""
    return f"{handle.link} {handle.kind}{number}"
