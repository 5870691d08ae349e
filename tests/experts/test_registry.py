import dataclasses

import numpy as np
import pytest

from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import PolicyError, UnknownNameError
from artiskill.experts.registry import make_expert
from artiskill.tasks import registry
from artiskill.tasks.registry import make_task, task_names, task_spec


@pytest.mark.parametrize("name", task_names())
def test_every_task_has_an_expert(name: str) -> None:
    env = ManipulationEnv(name)
    env.reset(seed=0)
    first = make_expert(name, env.task.robot)
    again = make_expert(name, env.task.robot, first.config)  # its file is not read a second time
    actions = []
    for expert in (first, again):
        expert.reset(env.snapshot, env.goal)
        actions.append(expert.act(env.snapshot, env.goal))
    assert actions[0].shape == env.action_space.shape
    np.testing.assert_array_equal(*actions)


def test_a_task_without_expert_is_explained(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = make_task("OpenCabinetDoor").robot
    without = dataclasses.replace(task_spec("OpenCabinetDoor"), expert=None)
    monkeypatch.setitem(registry._TASKS, "OpenCabinetDoor", without)
    with pytest.raises(PolicyError, match="there is no expert for OpenCabinetDoor; tasks with one: OpenCabinetDr"):
        make_expert("OpenCabinetDoor", robot)
    with pytest.raises(UnknownNameError, match="unknown task 'WashDishes'"):
        make_expert("WashDishes", robot)
