from pathlib import Path

import numpy as np
import pytest

from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import UnknownNameError
from artiskill.evaluation.evaluate import run_episode
from artiskill.evaluation.policies import Actor, RandomActor, load_policy


@pytest.fixture(scope="module")
def env() -> ManipulationEnv:
    return ManipulationEnv(objects=["cabinet-0005", "cabinet-0010"])


def first_action(actor: Actor, env: ManipulationEnv, level: int, name: str) -> np.ndarray:
    observation, info = env.reset(options={"level": level, "object": name})
    actor.reset(env, observation, info)
    return actor.act(env, observation)


def test_random_follows_level_and_object_only(env: ManipulationEnv) -> None:
    actor = RandomActor()
    first = first_action(actor, env, 3, "cabinet-0005")
    assert first.shape == (13,)
    assert np.abs(first).max() <= 1
    others = [first_action(actor, env, 4, "cabinet-0005"), first_action(actor, env, 3, "cabinet-0010")]
    assert not any(np.array_equal(first, other) for other in others)
    np.testing.assert_array_equal(first, first_action(RandomActor(), env, 3, "cabinet-0005"))


def test_still_asks_for_nothing(env: ManipulationEnv) -> None:
    action = first_action(load_policy("still"), env, 3, "cabinet-0005")
    assert action.shape == (13,)
    assert not action.any()


def test_the_expert_solves_a_level(env: ManipulationEnv) -> None:
    seen: list[tuple[int, bool]] = []
    result = run_episode(env, load_policy("expert"), 0, lambda _, steps, done: seen.append((steps, done)))
    assert result.success
    assert all(result.flags.values())
    assert [steps for steps, _ in seen] == list(range(result.length + 1))
    assert [done for _, done in seen] == [False] * result.length + [True]


def test_unknown_names() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'expert'"):
        load_policy("exprt")


def test_paths_may_be_text_or_path(root: Path) -> None:
    path = root / "examples" / "solution_example.py"
    assert load_policy(path).name == load_policy(str(path)).name == str(path)
