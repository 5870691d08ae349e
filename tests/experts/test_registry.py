import numpy as np
import pytest

from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import PolicyError
from artiskill.experts.registry import make_expert
from artiskill.tasks.registry import make_task, task_names


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


def test_a_task_without_expert_is_explained() -> None:
    robot = make_task("OpenCabinetDoor").robot
    with pytest.raises(
        PolicyError, match=r"there is no expert for WashDishes; tasks with one: OpenCabinetDrawer, "
    ):
        make_expert("WashDishes", robot)
