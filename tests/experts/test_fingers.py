"""Fingers close gently: none gets into what it grips, measured at every physics step."""

from dataclasses import dataclass

import mujoco
import numpy as np
import pytest

from artiskill.assets.catalog import list_objects, load_object
from artiskill.demos.demonstrator import Demonstrator
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.tasks.registry import make_task

_FULL = int(mujoco.mjtState.mjSTATE_INTEGRATION)
_DEEP_M = 1e-3


@dataclass
class Grip:
    """How an episode went: the greatest depth of a finger in the object, m, and physics steps beyond 1 mm."""

    solved: bool
    depth_m: float = 0.0
    deep_steps: int = 0


def played(task: str, name: str, target: str, level: int, variety: bool = True) -> Grip:
    """An episode, simulated a second time in single physics steps."""
    env = ManipulationEnv(task, objects=name)
    env.reset(options={"level": level, "target": target})
    demonstrator, grip, done = Demonstrator(env, variety), Grip(False), False
    demonstrator.begin(env)
    simulation, scene = env.simulation, env.scene
    model = simulation._models[0]
    data = mujoco.MjData(model)
    of_object = [
        scene.index.object_bodies.start <= body < scene.index.object_bodies.stop for body in model.geom_bodyid
    ]
    of_finger = ["finger" in model.body(int(body)).name for body in model.geom_bodyid]
    while not done:
        action = demonstrator.act(env)
        mujoco.mj_setState(model, data, simulation._batch.state[0], _FULL)
        data.ctrl[:] = env.control.to_targets(action[None].astype(np.float64), env.snapshot)[0]
        for _ in range(scene.physics.physics_steps_per_step):
            mujoco.mj_step(model, data)
            depths = [
                -contact.dist
                for contact in data.contact
                for one, other in ((contact.geom1, contact.geom2), (contact.geom2, contact.geom1))
                if of_finger[one] and of_object[other]
            ]
            depth = max(depths, default=0.0)
            grip.depth_m, grip.deep_steps = max(grip.depth_m, depth), grip.deep_steps + (depth > _DEEP_M)
        _, _, grip.solved, truncated, _ = env.step(action)
        done = grip.solved or truncated
    return grip


def rings() -> list[tuple[str, str, str, int]]:
    """Task, object, target and its number, of all handles that are thin rings."""
    return [
        (task, name, target, number)
        for task in ("OpenCabinetDrawer", "OpenCabinetDoor")
        for split in ("all", "ood")
        for name in list_objects(split=split, task=task)
        for number, target in enumerate(make_task(task).targets(load_object(name)))
        if load_object(name).handles_of(target)[0].kind == "ring"
    ]


@pytest.mark.parametrize(
    ("task", "name", "target", "level"),
    [
        ("OpenCabinetDrawer", "cabinet-0013", "link_0", 0),  # fingers that shut at once stick in these bars
        ("OpenCabinetDrawer", "cabinet-0013", "link_2", 5),
        ("OpenCabinetDoor", "cabinet-0082", "link_0", 0),
        ("PushChair", "chair-0001", "base", 0),
    ],
)
def test_fingers_stay_out_of_what_they_grip(task: str, name: str, target: str, level: int) -> None:
    grip = played(task, name, target, level)
    assert grip.solved
    assert grip.depth_m < 1.5e-3
    assert grip.deep_steps < 5


@pytest.mark.slow
@pytest.mark.parametrize(("task", "name", "target", "number"), rings())
def test_no_finger_sticks_in_a_ring(task: str, name: str, target: str, number: int) -> None:
    for level in range(number, number + 3):
        grip = played(task, name, target, level)
        assert grip.depth_m < 3e-3, "half of what is thinnest"
        assert grip.deep_steps < 10


@pytest.mark.slow
@pytest.mark.parametrize("name", list_objects(split="test", task="OpenCabinetDrawer"))
def test_the_plain_expert_hardly_dents_a_handle(name: str) -> None:
    """What docs/architecture.md says of the drawers of the test split."""
    for target in make_task("OpenCabinetDrawer").targets(load_object(name)):
        for level in range(3):
            grip = played("OpenCabinetDrawer", name, target, level, variety=False)
            assert grip.solved
            assert grip.depth_m < 0.7e-3
