"""Physics configuration into a MuJoCo specification: options, collision groups, contact parameters."""

from collections.abc import Iterable
from enum import IntFlag
from typing import Any

import mujoco

from artiskill.scene.physics import PhysicsConfig


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
