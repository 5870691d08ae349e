"""The ceiling must do the same physics, or it would be none."""

import numpy as np
import pytest

from artiskill.bench.cases import Case
from artiskill.bench.subjects import Ceiling, SingleSubject, VectorSubject, make_subject
from artiskill.tasks.registry import task_names

LEVELS = np.array([11, 4, 23, 7])


def final_states(subject: SingleSubject | VectorSubject, num_envs: int) -> list[np.ndarray]:
    env = subject._env.unwrapped
    if num_envs == 1:
        return [env.save_state().simulation.rows[0]]
    return [env.save_state(i).simulation.rows[0] for i in range(num_envs)]


@pytest.mark.parametrize("task", task_names())
@pytest.mark.parametrize("num_envs", [1, 4])
def test_the_ceiling_does_the_same_physics(task: str, num_envs: int) -> None:
    case = Case(task, "state", num_envs, min(2, num_envs), ("train",))
    subject, levels = make_subject(case), LEVELS[:num_envs]
    ceiling = Ceiling(subject.task, case.objects, case.num_threads)
    subject.start(levels)
    ceiling.start(levels)
    rng = np.random.default_rng(0)
    for _ in range(4):
        actions = rng.uniform(-1, 1, (num_envs, subject.action_size)).astype(np.float32)
        assert subject.step(actions) is False
        ceiling.step(ceiling.targets(actions))
    states = ceiling.states()
    for env, row in enumerate(final_states(subject, num_envs)):
        np.testing.assert_array_equal(states[env], row)


def test_chairs_of_several_layouts_are_all_stepped() -> None:
    case = Case("PushChair", "state", 12, 1, ("train",))
    subject = make_subject(case)
    ceiling = Ceiling(subject.task, case.objects, 1)
    ceiling.start(np.arange(12))
    assert len(ceiling._groups) > 1
    assert sorted(ceiling.states()) == list(range(12))


def test_restarts_begin_the_levels_they_are_given() -> None:
    subject = VectorSubject(Case("OpenCabinetDrawer", "state", 3, 1, ("test",)))
    subject.start(LEVELS[:3])
    subject.restart(np.array([0, 2]), np.array([100, 101]))
    assert subject._env.get_attr("level") == (100, 4, 101)


@pytest.mark.parametrize("num_envs", [1, 2])
def test_points_are_down_sampled(num_envs: int) -> None:
    subject = make_subject(Case("OpenCabinetDrawer", "pointcloud", num_envs, 1, ("cabinet-0003",), 100))
    space = subject._env.observation_space  # type: ignore[attr-defined]
    assert space["pointcloud"]["xyz"].shape == ((100, 3) if num_envs == 1 else (num_envs, 100, 3))
    subject.start(np.arange(num_envs))
    assert subject.step(np.zeros((num_envs, subject.action_size), np.float32)) is False
