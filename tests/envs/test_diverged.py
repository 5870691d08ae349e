"""Physics that runs away in one environment of a vector."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from artiskill.envs.vector_env import ManipulationVectorEnv
from artiskill.errors import DivergedError, ResetNeededError

CHAIRS = ["chair-0001", "chair-0002", "chair-0002"]  # of two layouts
STILL = np.zeros((3, 22), np.float32)


@pytest.fixture
def spoil() -> Callable[[ManipulationVectorEnv, int], None]:
    """Give one environment velocities that no physics survives."""

    def do(env: ManipulationVectorEnv, number: int) -> None:
        state = env.save_state(number)
        rows = state.simulation.rows.copy()
        rows[0, 40:60] = 1e9
        env.restore_state(number, replace(state, simulation=replace(state.simulation, rows=rows)))

    return do


def test_the_error_names_the_environment_and_the_others_have_stepped(
    spoil: Callable[[ManipulationVectorEnv, int], None],
) -> None:
    env = ManipulationVectorEnv(3, "PushChair", objects="all", num_threads=1)
    twin = ManipulationVectorEnv(3, "PushChair", objects="all", num_threads=1)
    for one in (env, twin):
        one.reset(options={"object": CHAIRS, "level": 1})
    spoil(env, 2)
    with pytest.raises(DivergedError, match=r"chair-0002 diverged in environments \[2\]"):
        env.step(STILL)
    twin.step(STILL)
    for number in (0, 1):
        ours, theirs = env.save_state(number), twin.save_state(number)
        assert ours.elapsed == theirs.elapsed == 1
        np.testing.assert_array_equal(ours.simulation.rows, theirs.simulation.rows)
    only = np.array([False, False, True])
    # another layout: what is left of it in its old place must trouble nobody
    env.reset(options={"reset_mask": only, "object": "chair-0001", "level": 3})
    for _ in range(2):
        env.step(STILL)
    env.reset(options={"reset_mask": only, "object": "chair-0002", "level": 3})
    env.step(STILL)


def test_restoring_mends_it(spoil: Callable[[ManipulationVectorEnv, int], None]) -> None:
    env = ManipulationVectorEnv(3, "PushChair", objects="chair-0002", num_threads=1)
    env.reset(options={"level": 1})
    good = env.save_state(1)
    spoil(env, 1)
    with pytest.raises(DivergedError, match=r"environments \[1\]"):
        env.step(STILL)
    env.restore_state(1, good)
    env.step(STILL)


@pytest.mark.parametrize("mode", ["next_step", "same_step", "disabled"])
@pytest.mark.parametrize("copy", [True, False])
def test_episodes_that_end_in_that_step_are_over(
    spoil: Callable[[ManipulationVectorEnv, int], None], mode: str, copy: bool
) -> None:
    env = ManipulationVectorEnv(
        3, "PushChair", "chair-0002", num_threads=1, autoreset_mode=mode, copy=copy, config={"episode_steps": 5}
    )
    env.reset(seed=0)
    late = env.save_state(0)
    env.restore_state(0, replace(late, elapsed=4))
    spoil(env, 2)
    with pytest.raises(DivergedError, match=r"environments \[2\]"):
        env.step(STILL)
    broken = np.array([False, False, True])
    if mode == "disabled":
        with pytest.raises(ResetNeededError, match=r"environments \[0\]"):
            env.step(STILL)
        broken[0] = True
    seen, _ = env.reset(options={"reset_mask": broken, "level": 3})
    moved = ManipulationVectorEnv(1, "PushChair", "chair-0002", num_threads=1)
    moved.reset(seed=1)
    np.testing.assert_array_equal(seen[1], moved.step(STILL[:1])[0][0])
    if mode != "disabled":
        _, _, terminated, truncated, info = env.step(STILL)
        assert env.save_state(0).elapsed == 0, "a new episode began"
        assert not (terminated | truncated)[0]
        level = info["level"][0]
        env.step(STILL)
        assert env.save_state(0).elapsed == 1
        assert env.get_attr("level")[0] == level
