"""Physics configuration: rates, solver and contact parameters, and how they reach the model."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntFlag
from typing import Any

import mujoco

from artiskill.config import check


@dataclass(frozen=True)
class ContactConfig:
    """Contact parameters; the recipe that holds a handle without sinking through it.

    Attributes:
        finger_friction: sliding friction of everything that a finger touches; fingers have priority.
        object_friction: sliding friction of the object.
        ground_friction: sliding friction of the ground and of the robot's other parts.
        impratio: ratio of frictional to normal constraint impedance; high values hinder slip.
        time_constant_steps: the constraints' time constant in physics steps (at least 2 is stable).
        impedance: MuJoCo's solimp: d_min, d_max, width (m), midpoint, power.
    """

    finger_friction: float = 2.0
    object_friction: float = 1.0
    ground_friction: float = 1.0
    impratio: float = 10.0
    time_constant_steps: float = 2.0
    impedance: tuple[float, ...] = (0.95, 0.99, 0.001, 0.5, 2.0)

    def __post_init__(self) -> None:
        check(self.time_constant_steps >= 2, "contact.time_constant_steps must be at least 2 for stability")
        check(len(self.impedance) == 5, "contact.impedance needs five numbers (MuJoCo's solimp)")
        check(
            min(self.finger_friction, self.object_friction, self.ground_friction) >= 0,
            "contact frictions must not be negative",
        )


@dataclass(frozen=True)
class PhysicsConfig:
    """Rates and solver.

    Attributes:
        timestep_s: of physics.
        physics_steps_per_control: physics steps per control step.
        control_steps_per_step: control steps per environment step.
        gravity_m_s2: along world z.
        solver_iterations: at most, of the Newton solver.
        contact: contact parameters.
    """

    timestep_s: float = 0.002
    physics_steps_per_control: int = 5
    control_steps_per_step: int = 5
    gravity_m_s2: float = -9.81
    solver_iterations: int = 100
    contact: ContactConfig = ContactConfig()

    def __post_init__(self) -> None:
        check(0 < self.timestep_s <= 0.01, f"physics.timestep_s must lie in (0, 0.01], not {self.timestep_s}")
        check(
            min(self.physics_steps_per_control, self.control_steps_per_step, self.solver_iterations) >= 1,
            "physics: step counts and solver_iterations must be at least 1",
        )

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


def set_options(spec: Any, physics: PhysicsConfig) -> None:
    """Units, integrator, solver, friction cone and rates of a specification."""
    spec.compiler.degree = False
    option = spec.option
    option.timestep = physics.timestep_s
    option.gravity = (0.0, 0.0, physics.gravity_m_s2)
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = physics.contact.impratio
    option.iterations = physics.solver_iterations


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
