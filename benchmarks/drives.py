"""How closely the native drives follow the paper's controller, and how well the fingers grip; see docs/control.md.

The reference is the controller of the benchmark's first release on our robot model, alone in space, in plain
MuJoCo: velocity drives of stiffness 0, a discrete low-pass at control rate on each joint's target, base targets
rotated into the world once per control step, gravity and Coriolis forces balanced exactly, PID fingers, no limits
of forces, no armature. Each variant replaces one of these by what our model does; `ours` replaces all.
"""

import argparse
import json
import math
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, CollisionShape, Joint, Link
from artiskill.envs.control import action_scale
from artiskill.geometry.rotations import quat_from_axis_angle, quat_from_matrix
from artiskill.robots.config import RobotConfig, load_robot
from artiskill.robots.model import BASE_JOINTS, add_robot
from artiskill.scene.physics import PhysicsConfig, set_joint_limits_solver, set_options
from artiskill.scene.scene import build_scene

CONTROL_STEPS_PER_ACTION = 5
CONTROL_S = 0.01
CUTOFF_HZ = 40.0
FINGER_DAMPING, PID_P, PID_D = 1.0, 1.0, 0.01
FIRST_RELEASE_RANGE_M = 100.0  # its finger targets reach from -100 to 100 m, which makes the PID a force command
GROUPS = {"base": slice(0, 2), "yaw": slice(2, 3), "lift": slice(3, 4), "arm": slice(4, 11)}
LIFT_M = 0.8
BROKEN_DOWN = (
    "turn 3.14 rad/s, sideways 0.5 m/s",
    "arm joints 0.94 rad/s steps",
    "random actions, new every 0.05 s",
)


@dataclass(frozen=True)
class Variant:
    """Which parts of the paper's controller are replaced by ours.

    Attributes:
        low_pass: exact continuous filter inside the actuator, instead of a discrete one at the control rate.
        own_frame: base drives act in its own frame at all times, instead of on world targets rotated per control.
        gravity_only: Coriolis forces are not balanced.
        efforts: the arm's drives have their joints' force limits.
        armature: joints have the armature that contacts need.
        servo: fingers by position servo (with its force limit and damping) instead of the PID.
        balanced_per_control: the reference's passive forces are taken once per control step, not per physics step.
        timestep_s: of physics.
        finger_reach_m: half of the range that finger actions map to, None for the fingers' own range.
        finger_limit_n: force limit of the PID's drive, None for none.
        impratio: of the contacts between fingers and bar, None for the project's own.
    """

    low_pass: bool = False
    own_frame: bool = False
    gravity_only: bool = False
    efforts: bool = False
    armature: bool = False
    servo: bool = False
    balanced_per_control: bool = False
    timestep_s: float = 0.002
    finger_reach_m: float | None = None
    finger_limit_n: float | None = None
    impratio: float | None = None


REFERENCE = Variant()
OURS = Variant(low_pass=True, own_frame=True, gravity_only=True, efforts=True, armature=True, servo=True)
VARIANTS = {
    "ours": OURS,
    "low-pass": replace(REFERENCE, low_pass=True),
    "base in own frame": replace(REFERENCE, own_frame=True),
    "gravity only": replace(REFERENCE, gravity_only=True),
    "force limits": replace(REFERENCE, efforts=True),
    "armature": replace(REFERENCE, armature=True),
    "finger servo": replace(REFERENCE, servo=True),
    "ours, but no force limits": replace(OURS, efforts=False),
    "ours, but Coriolis balanced": replace(OURS, gravity_only=False),
    "ours, but neither": replace(OURS, efforts=False, gravity_only=False),
    "reference, balanced per control step": replace(REFERENCE, balanced_per_control=True),
    "reference, physics at 2500 Hz": replace(REFERENCE, timestep_s=0.0004),
}


@dataclass(frozen=True, eq=False)
class Motion:
    """What a run did, at the end of each of its T control steps.

    Attributes:
        qvel: (T, R) joint velocities; the base's in its own frame.
        qpos: (T, R) joint positions.
        tool_w: (T, 3) tool centre.
    """

    qvel: np.ndarray
    qpos: np.ndarray
    tool_w: np.ndarray


def low_pass_weight(cutoff_hz: float, step_s: float) -> float:
    """Weight a of y += a (x - y) that damps by 3 dB exactly at the cut-off, as in the first release."""
    c = 1 - math.cos(2 * math.pi * cutoff_hz * step_s)
    return math.sqrt(c * c + 2 * c) - c


# -- robot alone ---------------------------------------------------------------------------------------------


def robot_model(config: RobotConfig, variant: Variant) -> Any:
    """The robot alone, without contacts; whatever `variant` does not replace is as in the paper."""
    spec = mujoco.MjSpec()
    set_options(spec, PhysicsConfig(timestep_s=variant.timestep_s))
    part = add_robot(spec, config)
    set_joint_limits_solver(spec.joints, PhysicsConfig())
    for geom in spec.geoms:
        geom.contype = geom.conaffinity = 0
    for body in spec.bodies[1:]:
        body.gravcomp = 1.0 if variant.gravity_only else 0.0
    for joint in spec.joints:
        joint.armature = joint.armature if variant.armature else 0.0
    for actuator in spec.actuators:
        _as_in_paper(actuator, variant)
    if not variant.servo:
        for name in (j for j in part.joints if "finger" in j):
            _paper_finger(spec, name, variant)
    return spec.compile()


def _as_in_paper(actuator: Any, variant: Variant) -> None:
    is_finger = "finger" in actuator.name
    if not variant.low_pass and not is_finger:
        actuator.dyntype = mujoco.mjtDyn.mjDYN_NONE
    if not variant.own_frame and actuator.name in BASE_JOINTS:
        actuator.trntype, actuator.target = mujoco.mjtTrn.mjTRN_JOINT, actuator.name
        actuator.gear = (1, 0, 0, 0, 0, 0)
    if not variant.efforts and not is_finger:
        actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_FALSE


def _paper_finger(spec: Any, name: str, variant: Variant) -> None:
    """A velocity drive of damping 1, without dry friction: 0.1 N would hold against all that the PID asks for."""
    spec.joint(name).frictionloss = 0.0
    actuator = spec.actuator(name)
    actuator.set_to_velocity(kv=FINGER_DAMPING)
    actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_FALSE
    if variant.finger_limit_n is not None:
        actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
        actuator.forcerange = (-variant.finger_limit_n, variant.finger_limit_n)


class Controller:
    """Targets to controls, once per control step; the state is that of the filters and of the PID."""

    def __init__(self, variant: Variant, joints: int) -> None:
        self.variant = variant
        self.weight = low_pass_weight(CUTOFF_HZ, CONTROL_S)
        self.filtered = np.zeros(joints)
        self.last_error: np.ndarray | None = None

    def __call__(self, targets: np.ndarray, qpos: np.ndarray) -> np.ndarray:
        """Controls of targets (own frame, fingers in metres)."""
        variant, wanted = self.variant, targets.copy()
        if not variant.own_frame:
            cos, sin = math.cos(qpos[2]), math.sin(qpos[2])
            wanted[:2] = cos * targets[0] - sin * targets[1], sin * targets[0] + cos * targets[1]
        if not variant.servo:
            error = targets[11:] - qpos[11:13]
            last = error if self.last_error is None else self.last_error
            wanted[11:] = PID_P * error + PID_D * (error - last) / CONTROL_S
            limit = FIRST_RELEASE_RANGE_M
            wanted[11:] = np.clip(wanted[11:], -limit, limit)
            self.last_error = error
        self.filtered += self.weight * (wanted - self.filtered)
        native = np.concatenate((np.full(11, variant.low_pass), np.full(2, variant.servo)))
        return np.where(native, wanted, self.filtered)


def run(config: RobotConfig, variant: Variant, actions: np.ndarray) -> Motion:
    """Actions (N, R) from rest, at 20 Hz."""
    model = robot_model(config, variant)
    data, tool = mujoco.MjData(model), model.site("right_tool_center").id
    data.qpos[3:] = LIFT_M, *config.initial.arm_qpos_rad, *[config.initial.finger_qpos_m] * 2
    controller, scale = Controller(variant, model.nu), action_scale(config)
    rows: list[tuple[np.ndarray, ...]] = []
    substeps = round(CONTROL_S / variant.timestep_s)
    for targets in np.repeat(scale.to_targets(actions), CONTROL_STEPS_PER_ACTION, axis=0):
        data.ctrl[:] = controller(targets, data.qpos)
        for k in range(substeps):
            mujoco.mj_step1(model, data)
            if not variant.gravity_only and (k == 0 or not variant.balanced_per_control):
                data.qfrc_applied[:] = data.qfrc_bias
            mujoco.mj_step2(model, data)
        mujoco.mj_kinematics(model, data)
        rows.append((_own_frame(data), data.qpos.copy(), data.site_xpos[tool].copy()))
    return Motion(*(np.array(column) for column in zip(*rows, strict=True)))


def _own_frame(data: Any) -> np.ndarray:
    qvel, yaw = data.qvel.copy(), data.qpos[2]
    cos, sin = math.cos(yaw), math.sin(yaw)
    qvel[:2] = cos * qvel[0] + sin * qvel[1], -sin * qvel[0] + cos * qvel[1]
    return qvel


# -- motions -------------------------------------------------------------------------------------------------


def motions(scale: np.ndarray, seconds: float) -> dict[str, np.ndarray]:
    """Action sequences (N, 13) at 20 Hz by name; `scale` is what +1 means."""
    n = round(seconds / (CONTROL_S * CONTROL_STEPS_PER_ACTION))
    t = np.arange(n)[:, None] * CONTROL_S * CONTROL_STEPS_PER_ACTION
    rng = np.random.default_rng(0)

    def held(**commands: float) -> np.ndarray:
        actions = np.zeros((n, len(scale)))
        for key, value in commands.items():
            actions[:, int(key[1:])] = value / scale[int(key[1:])]
        return actions

    fast, steps = held(), held()
    fast[:, 4:11] = np.cos(2 * math.pi * t * np.linspace(0.8, 1.6, 7) + np.arange(7))
    steps[:, 4:11] = 0.3 * np.sign(np.sin(2 * math.pi * t * 0.5 + 1e-9)) * (-1.0) ** np.arange(7)
    everything = rng.uniform(-1, 1, (n, len(scale)))
    smooth = np.repeat(rng.uniform(-1, 1, (n // 10 + 1, len(scale))), 10, axis=0)[:n]
    for actions in (everything, smooth):
        actions[:, 11:] = 0
    return {
        "hold still": held(),
        "base forward 0.5 m/s": held(j0=0.5),
        "lift 0.3 m/s up and down": held(j3=0.3) * np.sign(np.sin(2 * math.pi * t * 0.5 + 1e-9)),
        "arm joints 0.94 rad/s steps": steps,
        "turn 1 rad/s, sideways 0.2 m/s": held(j1=0.2, j2=1.0),
        "turn 3.14 rad/s, sideways 0.5 m/s": held(j1=0.5, j2=3.14),
        "fast arm (3.14 rad/s, about 1 Hz)": fast,
        "random actions, new every 0.05 s": everything,
        "random actions, new every 0.5 s": smooth,
    }


def differences(motion: Motion, reference: Motion, scale: np.ndarray) -> dict[str, float]:
    """RMS and largest differences: velocities in percent of what +1 means, then end positions."""
    relative = 100 * (motion.qvel - reference.qvel) / scale
    result: dict[str, float] = {}
    for name, joints in GROUPS.items():
        result[f"{name}_rms_percent"] = float(np.sqrt((relative[:, joints] ** 2).mean()))
        result[f"{name}_max_percent"] = float(np.abs(relative[:, joints]).max())
    end = motion.qpos[-1] - reference.qpos[-1]
    result["base_end_mm"] = float(1e3 * np.linalg.norm(end[:2]))
    result["yaw_end_mrad"] = float(1e3 * abs(end[2]))
    result["arm_end_mrad"] = float(1e3 * np.abs(end[GROUPS["arm"]]).max())
    result["tool_end_mm"] = float(1e3 * np.linalg.norm(motion.tool_w[-1] - reference.tool_w[-1]))
    return result


def tracking(motion: Motion, actions: np.ndarray, scale: np.ndarray) -> dict[str, float]:
    """How far velocities end from what was asked for, after the action has lasted 0.05 s (percent of +1)."""
    error = 100 * (motion.qvel[CONTROL_STEPS_PER_ACTION - 1 :: CONTROL_STEPS_PER_ACTION] / scale - actions)
    return {name: float(np.sqrt((error[:, joints] ** 2).mean())) for name, joints in GROUPS.items()}


# -- fingers -------------------------------------------------------------------------------------------------

# The fingers keep our armature here: without it 100 N drive their 15 g through the bar within one physics step.
FINGERS = {
    "ours: servo, targets 0 .. 40 mm": OURS,
    "ours, with impratio 100": replace(OURS, impratio=100.0),
    "PID, targets 0 .. 40 mm": REFERENCE,
    "PID, targets -100 .. 100 m, at most 20 N": replace(REFERENCE, finger_reach_m=100.0, finger_limit_n=20.0),
    "PID, targets -100 .. 100 m": replace(REFERENCE, finger_reach_m=100.0),
}
BAR_M = 0.012
# name -> shape and mass. Slip goes down with what hangs on the bar; 3 kg is a drawer, 0.1 kg a bar alone
BARS = {
    "square bar, 3 kg": ("square", 3.0),
    "round bar, 3 kg": ("round", 3.0),
    "square bar, 0.1 kg": ("square", 0.1),
}
PULL_N = 30.0


def bar_scene(config: RobotConfig, shape: str, mass_kg: float) -> Any:
    """A scene of the robot with a bar between its pads, which slides along the hand's z axis."""
    model = robot_model(config, OURS)
    data = mujoco.MjData(model)
    data.qpos[3:] = LIFT_M, *config.initial.arm_qpos_rad, 0.04, 0.04
    mujoco.mj_forward(model, data)
    site = model.site("right_tool_center").id
    quaternion = quat_from_matrix(data.site_xmat[site].reshape(3, 3))
    half, identity, none = BAR_M / 2, np.array((1.0, 0, 0, 0)), np.zeros((0, 3))
    if shape == "round":
        volume_m3 = math.pi * half**2 * 0.12
        across = quat_from_axis_angle((0, 1, 0), math.pi / 2)
        collision = CollisionShape("cylinder", (half, 0.06), np.zeros(3), across)
    else:
        volume_m3 = BAR_M**2 * 0.12
        collision = CollisionShape("box", (0.06, half, half), np.zeros(3), identity)
    joint = Joint("pull", "prismatic", np.array((0, 0, 1.0)), np.zeros(3), (-1.0, 1.0))
    root = Link("base", -1, data.site_xpos[site].copy(), quaternion, None, (), (), 500.0, none)
    bar = Link("link_0", 0, np.zeros(3), identity, joint, (), (collision,), mass_kg / volume_m3, none)
    obj = ArticulatedObject("bar", "cabinet", (root, bar), (), np.array([[-1, -1, 0], [1, 1, 2.0]]))
    return build_scene(config, obj, PhysicsConfig())


def grip(config: RobotConfig, variant: Variant, bar: tuple[str, float] | None) -> dict[str, float]:
    """Close the fingers from 40 mm for 2 s, then pull the bar with 30 N for 2 s; the rest of the robot is held.

    Returns:
        closing_s: until the bar is touched, or until 90 % of the stroke is done without a bar (None).
        force_n: of one finger on the bar before the pull; slip_mm: of the bar in the hand during the pull.
    """
    scene = bar_scene(config, *(bar or ("square", 1.0)))
    model, index = scene.model, scene.index
    data = mujoco.MjData(model)
    if bar is None:
        model.geom_contype[:] = model.geom_conaffinity[:] = 0
    model.dof_damping[:11] = 1e9  # held: what moves is the fingers' doing alone
    model.opt.gravity[:] = 0
    model.opt.impratio = variant.impratio or model.opt.impratio
    fingers = [model.actuator(n).id for n in scene.robot.actuators[-2:]]
    if not variant.servo:
        _paper_fingers_in(model, fingers, variant)
    data.qpos[3:13] = LIFT_M, *config.initial.arm_qpos_rad, 0.04, 0.04
    controller = Controller(variant, model.nu)
    targets = np.zeros(model.nu)
    targets[11:] = 0.0 if variant.finger_reach_m is None else -variant.finger_reach_m
    closing_s, force_n, pull = math.nan, 0.0, index.object_qpos.start
    before = 0.0
    for step in range(400):
        data.ctrl[fingers] = controller(targets, data.qpos)[11:]
        if step == 200:
            force_n, before = _finger_force(model, data, scene.robot.finger_geoms), float(data.qpos[pull])
            data.qfrc_applied[pull] = PULL_N
        for _ in range(5):
            mujoco.mj_step(model, data)
            touched = data.ncon > 0 if bar else data.qpos[11] < 0.004
            closing_s = data.time if math.isnan(closing_s) and touched else closing_s
    slip_mm = 1e3 * (float(data.qpos[pull]) - before)
    return {"closing_s": closing_s, "force_n": force_n, "slip_mm": slip_mm}


def _paper_fingers_in(model: Any, fingers: list[int], variant: Variant) -> None:
    model.actuator_gainprm[fingers, 0] = FINGER_DAMPING
    model.actuator_biasprm[fingers, :3] = 0, 0, -FINGER_DAMPING
    model.actuator_forcelimited[fingers] = variant.finger_limit_n is not None
    model.actuator_forcerange[fingers] = np.array((-1, 1)) * (variant.finger_limit_n or 0.0)
    model.dof_frictionloss[11:13] = 0


def _finger_force(model: Any, data: Any, finger_geoms: tuple[str, ...]) -> float:
    """Normal force on the bar, mean of the two fingers."""
    ids, force, total = {model.geom(n).id for n in finger_geoms}, np.zeros(6), 0.0
    for i in range(data.ncon):
        if ids & set(data.contact.geom[i].tolist()):
            mujoco.mj_contactForce(model, data, i, force)
            total += float(force[0])
    return total / 2


# -- report --------------------------------------------------------------------------------------------------


def measure(config: RobotConfig, seconds: float) -> dict[str, Any]:
    """All figures."""
    scale = action_scale(config).half_range
    compared: dict[str, Any] = {}
    for name, actions in motions(scale, seconds).items():
        reference = run(config, REFERENCE, actions)
        rows = {v: differences(run(config, variant, actions), reference, scale) for v, variant in VARIANTS.items()}
        ours = run(config, OURS, actions)
        errors = {"reference": tracking(reference, actions, scale), "ours": tracking(ours, actions, scale)}
        compared[name] = {"difference": rows, "tracking_rms_percent": errors}
        compared[name]["largest_speed"] = {
            who: float(np.abs(m.qvel).max()) for who, m in (("reference", reference), ("ours", ours))
        }
    gripping = {
        name: {"free": grip(config, variant, None), **{k: grip(config, variant, bar) for k, bar in BARS.items()}}
        for name, variant in FINGERS.items()
    }
    return {"motions": compared, "gripping": gripping, "low_pass": low_pass_figures()}


def low_pass_figures() -> dict[str, float]:
    """A step through both filters: what is still missing of it, in percent, by time."""
    weight, rate = low_pass_weight(CUTOFF_HZ, CONTROL_S), 2 * math.pi * CUTOFF_HZ
    figures = {"discrete_weight": weight, "exact_weight_per_control": 1 - math.exp(-rate * CONTROL_S)}
    figures["discrete_mean_delay_ms"] = 1e3 * CONTROL_S * (1 - weight) / weight
    figures["exact_mean_delay_ms"] = 1e3 / rate
    for controls in (1, 2, 5):
        figures[f"discrete_missing_percent_after_{controls}"] = 100 * (1 - weight) ** controls
        figures[f"exact_missing_percent_after_{controls}"] = 100 * math.exp(-rate * CONTROL_S * controls)
    return figures


def print_report(figures: dict[str, Any]) -> None:
    """The tables of docs/control.md."""
    columns = [f"{g}_{k}_percent" for g in GROUPS for k in ("rms", "max")]
    columns += ["base_end_mm", "yaw_end_mrad", "arm_end_mrad", "tool_end_mm"]
    heads = [c.replace("_percent", " %").replace("_", " ") for c in columns]
    _print_row("ours against the reference", heads)
    for name, entry in figures["motions"].items():
        _print_row(name, [entry["difference"]["ours"][c] for c in columns])
    for name in BROKEN_DOWN:
        print()
        _print_row(f"{name}:", heads)
        for variant, row in figures["motions"][name]["difference"].items():
            _print_row(f"  {variant}", [row[c] for c in columns])
    print()
    _print_row("tracking error, RMS %", [f"{who} {g}" for who in ("paper", "ours") for g in GROUPS])
    for name, entry in figures["motions"].items():
        errors = entry["tracking_rms_percent"]
        _print_row(name, [errors[who][g] for who in ("reference", "ours") for g in GROUPS])
    print()
    _print_row(
        "fingers",
        [
            "close free s",
            "to bar s",
            "force N",
            *(n.replace("square bar", "mm sq.").replace("round bar", "mm round") for n in BARS),
        ],
    )
    for name, entry in figures["gripping"].items():
        bars = [entry[k] for k in BARS]
        slips = [bar["slip_mm"] for bar in bars]
        _print_row(name, [entry["free"]["closing_s"], bars[0]["closing_s"], bars[0]["force_n"], *slips])
    print("\n" + "\n".join(f"{k:40}{v:10.4g}" for k, v in figures["low_pass"].items()))


def _print_row(label: str, cells: Iterable[float | str]) -> None:
    texts = (cell if isinstance(cell, str) else _short(cell) for cell in cells)
    print(f"{label:42}" + "".join(f"{text:>15}" for text in texts))


def _short(value: float) -> str:
    return "0" if abs(value) < 5e-4 else f"{value:.3g}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", default="one_arm")
    parser.add_argument("--seconds", type=float, default=10.0, help="length of each motion")
    parser.add_argument("--json", help="also write the figures to this file")
    arguments = parser.parse_args()
    start = time.perf_counter()
    config = load_robot(arguments.robot)
    assert action_scale(config).center.shape == (13,), "the columns are those of a robot with one arm"
    figures = measure(config, arguments.seconds)
    print_report(figures)
    print(f"mujoco {mujoco.__version__}, {time.perf_counter() - start:.0f} s")
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as file:
            json.dump(figures, file, indent=2)


if __name__ == "__main__":
    main()
