"""Episodes of training agents in which an expert takes over."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("sbx", reason="needs the extra rl: `make test-rl`")

from artiskill.envs.vector_env import ManipulationVectorEnv
from artiskill.errors import ConfigError, PolicyError
from artiskill.experts import registry
from artiskill.learning import expert_takeover, reinforcement
from artiskill.learning.expert_takeover import ExpertTakeover
from artiskill.learning.reinforcement import reinforce
from artiskill.learning.reinforcement_config import load_reinforcement_config, read_reinforcement_config
from artiskill.learning.run import CONFIG, Table
from artiskill.tasks.registry import task_spec

TASK, OBJECT = "OpenCabinetDrawer", "cabinet-0003"
TINY: dict[str, Any] = {
    "objects": [OBJECT],
    "target": "link_0",
    "steps": 800,
    "envs": 4,
    "log_every": 400,
    "evaluation.episodes": 2,
    "evaluation.every": 800,
    "algorithm.net_arch": [16],
    "algorithm.batch_size": 16,
    "algorithm.learning_starts": 100,
    "algorithm.buffer_size": 800,
    "algorithm.expert_share": 1.0,
    "algorithm.takeover_steps": [3, 3],
}


def make_env(count: int) -> ManipulationVectorEnv:
    env = ManipulationVectorEnv(count, TASK, [OBJECT], target="link_0", autoreset_mode="same_step")
    env.reset(seed=3)
    return env


def test_the_expert_solves_what_the_agent_left_it() -> None:
    env = make_env(4)
    expert, solved = ExpertTakeover(env, 1.0, (5, 20), seed=1), np.zeros(4, dtype=bool)
    by_agent = np.zeros(4, dtype=int)
    for _ in range(150):
        given = np.full((4, 13), 0.25)
        acted, actions = expert.has_taken_over, expert.replace(given)
        assert (actions[~acted] == 0.25).all()
        assert (actions[acted] != 0.25).any(axis=1).all()
        assert (given == 0.25).all(), "the agent's are left as they are"
        _, _, terminated, truncated, _ = env.step(actions)
        by_agent += ~acted & ~solved
        solved |= terminated
        expert.advance(terminated | truncated)
    assert solved.all()
    assert by_agent.min() >= 5, "the agent acts first"
    assert by_agent.max() <= 20


@pytest.mark.parametrize(("length", "share"), [(5, 0.25), (4, 0.25 * 2 / 3), (2, 0.0)])
def test_a_share_of_the_episodes_is_ended_by_the_expert(length: int, share: float) -> None:
    """Of those that last until it takes over, in their third to fifth step."""
    expert = ExpertTakeover(make_env(8), 0.25, (2, 4), seed=1)
    drawn, ended = [], []
    for _ in range(100):
        for step in range(length):
            drawn.append(expert.is_drawn)
            ended.append(expert.has_taken_over & (step == length - 1))
            expert.advance(np.full(8, step == length - 1))
    assert np.mean(drawn) == pytest.approx(0.25, abs=0.05)
    assert np.sum(ended) / 800 == pytest.approx(share, abs=0.05 * (share > 0))


def test_it_goes_on_from_its_state() -> None:
    env = make_env(4)
    first, second = (ExpertTakeover(env, 0.5, (0, 9), seed) for seed in (1, 2))
    for step in range(30):
        first.advance(np.arange(4) == step % 4)
    second.state = first.state
    for step in range(50):
        assert (first.has_taken_over == second.has_taken_over).all()
        assert (first.is_drawn == second.is_drawn).all()
        for one in (first, second):
            one.advance(np.arange(4) == step % 3)


def test_where_the_expert_is_at_a_loss_the_agent_acts(monkeypatch: pytest.MonkeyPatch) -> None:
    answers: list[Any] = [FloatingPointError("lost"), np.full(13, np.nan), np.full(13, 7.0)]

    class Lost:
        def act(self, snapshot: Any, goal: Any) -> np.ndarray:
            answer = answers.pop(0)
            if isinstance(answer, Exception):
                raise answer
            return np.asarray(answer)

    monkeypatch.setattr(expert_takeover, "make_expert", lambda task, robot: Lost())
    actions = ExpertTakeover(make_env(3), 1.0, (0, 0), seed=1).replace(np.zeros((3, 13)))
    assert (actions[:2] == 0).all()
    assert (actions[2] == 1).all(), "in [-1, 1]"


def test_the_replay_buffer_has_what_was_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Constant:
        def act(self, snapshot: Any, goal: Any) -> np.ndarray:
            return np.full(13, 0.125)

    done: list[np.ndarray] = []
    step = ManipulationVectorEnv.step

    def watched(env: ManipulationVectorEnv, actions: np.ndarray) -> Any:
        if env.num_envs == 4:  # not those of measurements
            done.append(np.array(actions))
        return step(env, actions)

    monkeypatch.setattr(ManipulationVectorEnv, "step", watched)
    monkeypatch.setattr(expert_takeover, "make_expert", lambda task, robot: Constant())
    run = reinforce(load_reinforcement_config("sac", TASK, TINY | {"steps": 400}), tmp_path / "run")
    stored = run.model.replay_buffer.actions[:100]  # (steps, environments, actions)
    assert np.array_equal(stored, np.array(done, dtype=np.float32))
    assert (stored[3:] == 0.125).all(), "no episode ends before 200 steps"
    assert (stored[:3] != 0.125).any(axis=-1).all()


def test_runs_count_episodes_of_the_expert_apart(tmp_path: Path) -> None:
    reinforce(load_reinforcement_config("sac", TASK, TINY), tmp_path / "run")
    rows = Table(tmp_path / "run/metrics.csv", 10**9).rows
    ended = [float(row["expert_success"]) for row in rows if row.get("expert_success")]
    assert ended
    assert np.mean(ended) > 0.8
    assert not any(row.get("success") for row in rows), "all episodes are the expert's"


def test_what_ends_before_the_expert_takes_over_counts_for_nobody(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It would favour the agent, whose failures are then the expert's."""
    short = TINY | {"config.episode_steps": 20, "algorithm.takeover_steps": [0, 19]}
    monkeypatch.setattr(reinforcement._Loop, "log", lambda loop: None)  # which begins to count anew
    sums = []
    for share in (0.0, 0.5):
        config = load_reinforcement_config("sac", TASK, short | {"algorithm.expert_share": share})
        run = reinforce(config, tmp_path / str(share))
        sums.append({name: count for name, (_, count) in run.state.sums.items() if "success" in name})
    assert sums[0] == {"success": 40}, "4 environments, 10 episodes of each"
    assert 10 < sums[1]["success"] < 30
    assert 10 < sums[1]["expert_success"] < 30


def test_a_run_of_an_older_version_is_read(tmp_path: Path) -> None:
    config = load_reinforcement_config("sac", TASK, {"steps": 100})
    (tmp_path / CONFIG).write_text(reinforcement.dump_yaml(config))
    own = ("expert_share", "takeover_steps")
    kept = [line for line in (tmp_path / CONFIG).read_text().splitlines() if not any(name in line for name in own)]
    assert len(kept) + len(own) <= len((tmp_path / CONFIG).read_text().splitlines())
    (tmp_path / CONFIG).write_text("\n".join(kept))
    config.check_continues(read_reinforcement_config(tmp_path), tmp_path)


def test_a_task_without_an_expert_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "task_spec", lambda task: replace(task_spec(task), expert=None))
    with pytest.raises(PolicyError, match=f"no expert for {TASK}"):
        reinforce(load_reinforcement_config("sac", TASK, TINY), tmp_path / "run")
    assert not (tmp_path / "run" / CONFIG).exists()


def test_an_expert_that_never_takes_over_is_refused(tmp_path: Path) -> None:
    late = TINY | {"algorithm.takeover_steps": [150, 200]}
    with pytest.raises(ConfigError, match="takeover_steps must lie below the 200 steps of an episode, not at 200"):
        reinforce(load_reinforcement_config("sac", TASK, late), tmp_path / "run")
    assert not (tmp_path / "run" / CONFIG).exists()
    reinforce(load_reinforcement_config("sac", TASK, late | {"algorithm.expert_share": 0.0}), tmp_path / "run")
