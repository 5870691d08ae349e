"""What a check gets, a `CheckContext` with the object and its models, and the `CheckResult`s that it returns."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import mujoco
import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, Joint
from artiskill.assets.kinematics import link_poses
from artiskill.checks.config import CategoryConfig, ChecksConfig, DynamicsConfig
from artiskill.scene.object_model import (
    WHEEL_PART,
    ObjectScene,
    build_object_scene,
    object_spec,
    resolve_object_scene,
)
from artiskill.scene.physics import ContactConfig, PhysicsConfig

Limits = tuple[float | None, float | None]
FREE = DynamicsConfig(0.0, 0.0)
_ROUNDING = 1 + 1e-9


@dataclass(frozen=True)
class CheckResult:
    """One finding.

    Attributes:
        check: name of the check, one of `runner.CHECKS`; empty until the runner enters it.
        subject: what was looked at: a link, a pair of links, a joint, a handle, or `object`.
        value: what was measured; None where there is nothing to measure.
        limit: lowest and highest legal value, each None where there is none.
        unit: of value and limit.
        passed: whether the value is legal.
        note: what a person wants to know beside the numbers; where a check fails, what is wrong.
    """

    check: str
    subject: str
    value: float | None
    limit: Limits
    unit: str
    passed: bool
    note: str = ""

    @property
    def legal(self) -> str:
        """The limit as text, `<= 1 mm` say."""
        low, high = self.limit
        if low is None and high is None:
            return ""
        unit = f" {self.unit}" if self.unit else ""
        if low is None:
            return f"<= {high:g}{unit}"
        return f">= {low:g}{unit}" if high is None else f"{low:g} to {high:g}{unit}"

    @property
    def measured(self) -> str:
        """The value as text."""
        if self.value is None:
            return ""
        digits = ".0f" if self.unit == "" or abs(self.value) >= 99.95 else ".2f" if abs(self.value) < 10 else ".1f"
        return f"{self.value:{digits}}{' ' if self.unit else ''}{self.unit}"


def at_most(subject: str, value: float, limit: float, unit: str = "", note: str = "") -> CheckResult:
    """Return the result for a value that must not exceed a limit; NaN fails."""
    return CheckResult("", subject, float(value), (None, limit), unit, bool(value <= limit * _ROUNDING), note)


def at_least(subject: str, value: float, limit: float, unit: str = "", note: str = "") -> CheckResult:
    """Return the result for a value that must not fall short of a limit; NaN fails."""
    return CheckResult("", subject, float(value), (limit, None), unit, bool(value * _ROUNDING >= limit), note)


def within(subject: str, value: float, limits: tuple[float, ...], unit: str) -> CheckResult:
    """Return the result for a value that must lie between two limits."""
    low, high = limits
    return CheckResult("", subject, value, (low, high), unit, math.isfinite(value) and low <= value <= high)


def failed(subject: str, note: str) -> CheckResult:
    """Return a fault that has no number."""
    return CheckResult("", subject, None, (None, None), "", False, note)


def fine(subject: str, note: str) -> CheckResult:
    """Return a pass that has no number, or for which there is nothing to look at."""
    return CheckResult("", subject, None, (None, None), "", True, note)


@dataclass(eq=False)
class CheckContext:
    """One object under examination, the config, and what several checks need of them, computed once each."""

    object: ArticulatedObject
    config: ChecksConfig

    @property
    def limits(self) -> CategoryConfig:
        """What holds for objects of its category."""
        return self.config.of(self.object.category)

    @property
    def joints(self) -> tuple[Joint, ...]:
        """All joints."""
        return self.object.joints

    @property
    def rest(self) -> np.ndarray:
        """Joint values at rest, (J,)."""
        return self.object.rest_qpos

    @cached_property
    def rest_poses(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions (L, 3) and quaternions (L, 4) of all links at rest, in the object frame."""
        return link_poses(self.object, self.rest)

    @property
    def physics(self) -> PhysicsConfig:
        """The benchmark's physics, with the friction of the category's task."""
        limits = self.limits
        contact = ContactConfig(object_friction=limits.object_friction, ground_friction=limits.ground_friction)
        return PhysicsConfig(contact=contact)

    @cached_property
    def scene(self) -> ObjectScene:
        """Object and ground as the simulation has them.

        Raises:
            ValueError: the engine refuses the object.
        """
        return build_object_scene(self.object, self.physics)

    @cached_property
    def overlap_probe(self) -> "OverlapProbe":
        """The links' shapes, all of which can meet one another."""
        return OverlapProbe(self.object)

    @cached_property
    def on_wheels(self) -> np.ndarray:
        """For each joint, whether some link from there on has wheels, (J,).

        The swivel of a caster is one too: what hangs from it is a fork and its wheels. A seat has wheels nowhere.
        """
        links = self.object.links
        wheeled = [any(shape.part == WHEEL_PART for shape in link.collisions) for link in links]
        return np.array([any(wheeled[i] for i in self.carried(k)) for k in range(len(self.joints))], dtype=bool)

    def carried(self, joint: int) -> set[int]:
        """Return the links that a joint moves."""
        moved = {self.object.jointed_links[joint]}
        for i, link in enumerate(self.object.links):
            if link.parent in moved:
                moved.add(i)
        return moved

    def model_with(
        self, joints: DynamicsConfig = FREE, wheels: DynamicsConfig = FREE, scene: ObjectScene | None = None
    ) -> Any:
        """Return a copy of a scene's model, by default of `self.scene`, with friction and damping in joints."""
        scene = scene or self.scene
        model = mujoco.MjModel.__copy__(scene.model)
        for column, name in (("friction", "dof_frictionloss"), ("damping", "dof_damping")):
            values = np.where(self.on_wheels, getattr(wheels, column), getattr(joints, column))
            target = getattr(model, name)
            target[scene.dofs] = values if target.ndim == 1 else values[:, None]
        return model


@dataclass(frozen=True)
class Overlap:
    """Two links that share space.

    Attributes:
        links: indices of both, the lower first.
        depth_m: of the deepest pair of their shapes.
        parts: names of the parts that these shapes belong to.
    """

    links: tuple[int, int]
    depth_m: float
    parts: tuple[str, str]


class OverlapProbe:
    """The links' shapes in a model of its own, where all can meet, parents and children included."""

    def __init__(self, obj: ArticulatedObject) -> None:
        """Compile the model.

        Raises:
            ValueError: the engine refuses the object.
        """
        spec, part = object_spec(obj, PhysicsConfig(), ground=False, hold=True)
        spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_FILTERPARENT)
        for geom in spec.geoms:
            geom.contype = geom.conaffinity = 1
        self._scene = resolve_object_scene(spec.compile(), obj, part)
        self._data: Any = mujoco.MjData(self._scene.model)
        link_of_body = {int(body): i for i, body in enumerate(self._scene.bodies)}
        self._links = [link_of_body[int(body)] for body in self._scene.model.geom_bodyid]
        self._parts = [shape.part for link in obj.links for shape in link.collisions]

    def overlaps(self, qpos: np.ndarray) -> list[Overlap]:
        """Return the pairs of links that overlap at joint values (J,), the deepest first.

        Of each pair it is the deepest pair of shapes. Geometry only: nothing moves by itself.
        """
        data = self._data
        data.qpos[self._scene.qpos] = qpos
        collide(self._scene.model, data)
        deepest: dict[tuple[int, int], Overlap] = {}
        for (first, second), distance in zip(data.contact.geom.tolist(), data.contact.dist.tolist(), strict=True):
            a, b = sorted((first, second), key=lambda geom: self._links[geom])
            links = (self._links[a], self._links[b])
            if distance < 0 and (links not in deepest or -distance > deepest[links].depth_m):
                deepest[links] = Overlap(links, -distance, (self._parts[a], self._parts[b]))
        return sorted(deepest.values(), key=lambda o: (-o.depth_m, o.links))


def collide(model: Any, data: Any) -> None:
    """Find all contacts for the joint values in `data`, without a step."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_collision(model, data)
