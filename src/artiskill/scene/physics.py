"""Physics configuration: rates, solver and contact parameters, and how they come into a model."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntFlag
from typing import Any, Literal

import mujoco

from artiskill.config import check_not_negative, check_positive, check_value

_MOST = 10_000  # of any loop in a step: more would look like a hang
_ITERATIONS = ("solver_iterations", "line_search_iterations")


@dataclass(frozen=True)
class ContactConfig:
    """Contact parameters; the recipe that holds a handle without sinking through it.

    Attributes:
        finger_friction: sliding friction of everything that a finger touches; fingers have priority.
        object_friction: sliding friction of the object.
        wheel_friction: sliding friction of the object's wheels, the shapes whose part is `wheel`.
        ground_friction: sliding friction of the ground and of the robot's other parts.
        impratio: ratio of frictional to normal constraint impedance; high values hinder slip.
        time_constant_steps: the constraints' time constant in physics steps (at least 2 is stable).
        impedance: of the constraints, MuJoCo's solimp: d_min, d_max, width (m), midpoint, power.
    """

    finger_friction: float = 2.0
    object_friction: float = 1.0
    wheel_friction: float = 1.0
    ground_friction: float = 1.0
    impratio: float = 10.0
    time_constant_steps: float = 2.0
    impedance: tuple[float, ...] = (0.95, 0.99, 0.001, 0.5, 2.0)

    def __post_init__(self) -> None:
        check_not_negative(self, "finger_friction", "object_friction", "wheel_friction", "ground_friction")
        check_positive(self, "impratio")
        check_value(
            self,
            "time_constant_steps",
            2 <= self.time_constant_steps < math.inf,
            "must be at least 2 for stability",
        )
        legal = len(self.impedance) == 5 and 0 < self.impedance[0] <= self.impedance[1] < 1
        legal = legal and self.impedance[2] > 0 and 0 < self.impedance[3] < 1 and self.impedance[4] >= 1
        rule = "needs 0 < d_min <= d_max < 1, width > 0, 0 < midpoint < 1, power >= 1"
        check_value(self, "impedance", legal and all(map(math.isfinite, self.impedance)), rule)


@dataclass(frozen=True)
class PhysicsConfig:
    """Rates, integrator, solver and contacts; MuJoCo's own documentation says more about all but the first.

    Attributes:
        timestep_s: of a physics step.
        physics_steps_per_control: physics steps per control step.
        control_steps_per_step: control steps per environment step.
        gravity_m_s2: along world z.
        integrator: `implicitfast` and `implicit` take forces that depend on velocity, the drives' above all,
            implicitly, `implicit` Coriolis forces too; `euler` and `rk4` need smaller steps for stiffer drives.
        solver: of the constraints: `newton`, `cg` (conjugate gradients) or `pgs` (Gauss-Seidel).
        solver_iterations: of the solver, at most, per physics step.
        solver_tolerance: the solver stops where an iteration improves less than this; with 0 it never does.
        line_search_iterations: of the line search, at most, per iteration of `newton` and `cg`.
        line_search_tolerance: a line search stops where the slope has fallen to this share.
        noslip_iterations: of a second solver, after the first, that takes out slip; 0 leaves it out.
        cone: friction cones: `elliptic`, or `pyramidal`, faster and not the same in all directions.
        contact: contact parameters.
    """

    timestep_s: float = 0.002
    physics_steps_per_control: int = 5
    control_steps_per_step: int = 5
    gravity_m_s2: float = -9.81
    integrator: Literal["implicitfast", "implicit", "euler", "rk4"] = "implicitfast"
    solver: Literal["newton", "cg", "pgs"] = "newton"
    solver_iterations: int = 100
    solver_tolerance: float = 1e-8
    line_search_iterations: int = 50
    line_search_tolerance: float = 0.01
    noslip_iterations: int = 0
    cone: Literal["elliptic", "pyramidal"] = "elliptic"
    contact: ContactConfig = ContactConfig()

    def __post_init__(self) -> None:
        check_value(self, "timestep_s", 0 < self.timestep_s <= 0.01, "must lie in (0, 0.01]")
        check_value(self, "gravity_m_s2", math.isfinite(self.gravity_m_s2), "must be finite")
        for name in ("physics_steps_per_control", "control_steps_per_step", *_ITERATIONS):
            check_value(self, name, 1 <= getattr(self, name) <= _MOST, f"must be at least 1, at most {_MOST}")
        legal = 0 <= self.noslip_iterations <= _MOST
        check_value(self, "noslip_iterations", legal, f"must be at least 0, at most {_MOST}")
        for name in ("solver_tolerance", "line_search_tolerance"):
            check_value(self, name, 0 <= getattr(self, name) < 1, "must lie in [0, 1)")

    @property
    def physics_steps_per_step(self) -> int:
        """Physics steps in one environment step."""
        return self.physics_steps_per_control * self.control_steps_per_step

    @property
    def step_s(self) -> float:
        """Duration of one environment step."""
        return self.timestep_s * self.physics_steps_per_step


class Group(IntFlag):
    """Collision groups, as MuJoCo's contype bits."""

    ROBOT = 1
    OBJECT = 2
    GROUND = 4
    LOOSE = 8  # free bodies of a task, such as a ball
    TRUNK = 16  # the robot's own torso, column and platform, for its forearms and hands
    FIRST_ARM = 32  # forearm, hand and fingers of the first arm, for those of the second


def set_options(spec: Any, physics: PhysicsConfig) -> None:
    """Units, integrator, solver, friction cone and rates of a specification."""
    spec.compiler.degree = False
    option = spec.option
    option.timestep = physics.timestep_s
    option.gravity = (0.0, 0.0, physics.gravity_m_s2)
    option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{physics.integrator.upper()}")
    option.solver = getattr(mujoco.mjtSolver, f"mjSOL_{physics.solver.upper()}")
    option.cone = getattr(mujoco.mjtCone, f"mjCONE_{physics.cone.upper()}")
    option.impratio = physics.contact.impratio
    option.iterations, option.tolerance = physics.solver_iterations, physics.solver_tolerance
    option.ls_iterations, option.ls_tolerance = physics.line_search_iterations, physics.line_search_tolerance
    option.noslip_iterations = physics.noslip_iterations


def set_contact(geom: Any, group: Group, collides_with: Group, friction: float, physics: PhysicsConfig) -> None:
    """Collision groups, friction and constraint parameters of one geom."""
    geom.contype = int(group)
    geom.conaffinity = int(collides_with)
    geom.friction[0] = friction
    geom.solref = _solref(physics)
    geom.solimp = physics.contact.impedance


def set_joint_limits_solver(joints: Iterable[Any], physics: PhysicsConfig) -> None:
    """Joint limits as stiff as contacts."""
    for joint in joints:
        joint.solref_limit = _solref(physics)
        joint.solimp_limit = physics.contact.impedance


def _solref(physics: PhysicsConfig) -> tuple[float, float]:
    return (physics.contact.time_constant_steps * physics.timestep_s, 1.0)
