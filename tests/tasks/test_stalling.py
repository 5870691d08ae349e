"""Putting off success does not pay: an expert that finishes earns more than one that never leaves things still."""

import pytest

from artiskill.envs.manipulation import ManipulationEnv
from artiskill.evaluation.policies import load_policy

FORWARD, BACK = 1.0, -1.0


def play(env: ManipulationEnv, push: float | None) -> tuple[float, bool]:
    """Return of the expert on level 0, and whether it solves it; `push` moves the base when success is near."""
    expert = load_policy("expert")
    observation, info = env.reset(seed=0)
    expert.reset(env, observation, info)
    score, done, solved = 0.0, False, False
    while not done:
        action = expert.act(env, observation).copy()
        if push is not None and env.save_state().streaks.min() >= 7:  # of the ten steps that success must hold
            action[0] = push
        observation, reward, solved, truncated, info = env.step(action)
        assert reward <= 0
        score += reward
        done = solved or truncated
    return score, solved


@pytest.mark.parametrize(
    ("task", "object_id", "pushes"),
    [
        ("OpenCabinetDrawer", "cabinet-0003", [FORWARD]),  # pulled back, it stands still at its end
        pytest.param("PushChair", "chair-0001", [FORWARD, BACK], marks=pytest.mark.slow),
        pytest.param("MoveBucket", "bucket-0001", [FORWARD, BACK], marks=pytest.mark.slow),
    ],
)
def test_an_expert_that_never_finishes_earns_less(task: str, object_id: str, pushes: list[float]) -> None:
    env = ManipulationEnv(task, objects=object_id)
    finished, solved = play(env, None)
    assert solved
    for push in pushes:
        stalled, solved = play(env, push)
        assert not solved, "this test means to stall"
        assert stalled < finished - 10
