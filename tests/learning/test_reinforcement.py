"""Reinforcement learning: runs, checkpoints, going on, and runs as policies."""
# ruff: noqa: E402

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("sbx", reason="needs the extra rl: `make test-rl`")

import artiskill
from artiskill.cli.main import main
from artiskill.demos.demos import Demos
from artiskill.errors import ConfigError, PolicyError, RunError, UnknownNameError
from artiskill.learning import reinforcement
from artiskill.learning.checkpoints import read_content
from artiskill.learning.reinforcement import Run, reinforce
from artiskill.learning.reinforcement_config import load_reinforcement_config
from artiskill.learning.reinforcement_models import load_model_state, model_state
from artiskill.learning.run import BEST, LATEST, Table, load_run

TASK, OBJECT = "OpenCabinetDrawer", "cabinet-0003"
TINY: dict[str, Any] = {
    "objects": [OBJECT],
    "target": "link_0",
    "steps": 400,
    "envs": 4,
    "log_every": 100,
    "checkpoint_every": 200,
    "evaluation.episodes": 2,
    "evaluation.every": 400,
    "algorithm.net_arch": [16],
    "algorithm.batch_size": 16,
}
OWN = {"sac": {"algorithm.learning_starts": 100, "algorithm.buffer_size": 300}, "ppo": {"algorithm.n_steps": 20}}


def tiny(name: str, **changes: Any) -> Any:
    return load_reinforcement_config(name, TASK, TINY | OWN[name] | changes)


def weights(folder: Path) -> dict[str, np.ndarray]:
    acting = read_content(folder / LATEST)["acting"]
    return {f"{kind}{i}": one.numpy() for kind in ("weights", "biases") for i, one in enumerate(acting[kind])}


def equal(a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> bool:
    return all((a[name] == b[name]).all() for name in a)


# short episodes: some have ended before the checkpoint
GUIDED = {"config.episode_steps": 20, "algorithm.expert_share": 0.7, "algorithm.takeover_steps": [0, 15]}


@pytest.mark.parametrize(
    ("name", "changes"), [("sac", {}), ("sac", GUIDED), ("sac", {"algorithm.learning_starts": 300}), ("ppo", {})]
)
def test_an_interrupted_run_ends_with_the_same_bits(
    name: str, changes: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = reinforce(tiny(name, **changes), tmp_path / "whole")
    assert whole.state.step == 400
    begun = tmp_path / "begun"
    real, saves = reinforcement.Run.save, []

    def save_and_die(run: Any) -> None:
        real(run)
        saves.append(run.state.step)
        raise MemoryError

    monkeypatch.setattr(reinforcement.Run, "save", save_and_die)
    with pytest.raises(MemoryError):
        reinforce(tiny(name, **changes), begun)
    monkeypatch.undo()
    assert 0 < saves[0] < 400
    starts: list[int] = []
    reinforce(tiny(name, **changes), begun, on_start=starts.append)
    assert starts == saves
    assert equal(weights(tmp_path / "whole"), weights(begun))
    assert (tmp_path / "whole/development.csv").read_bytes() == (begun / "development.csv").read_bytes()
    assert len(list((begun / "checkpoints").glob("going-on-*.pkl"))) == 1


SCRIPT = """
import os, sys, jax
from pathlib import Path
os.sched_setaffinity(0, range(int(sys.argv[1])))
from tests.learning.test_reinforcement import reinforce, tiny, weights
for name in ("sac", "ppo"):
    out = Path(sys.argv[2]) / name
    reinforce(tiny(name, **{"algorithm.net_arch": [256, 256], "algorithm.batch_size": 256, "steps": 300}), out)
    print(name, [float(one.sum()) for one in weights(out).values()])
print(jax.default_backend())
"""


def test_bits_do_not_depend_on_how_many_cores_there_are(tmp_path: Path) -> None:
    found = []
    for cores in ("1", "2"):
        command = [sys.executable, "-c", SCRIPT, cores, str(tmp_path / cores)]
        environment = {name: value for name, value in os.environ.items() if name != "NPROC"}
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
        assert done.returncode == 0, done.stderr
        found.append(done.stdout)
    assert found[0] == found[1]
    assert found[0].endswith("cpu\n")


@pytest.mark.parametrize("name", ["sac", "ppo"])
def test_a_model_goes_back_to_where_it_was(name: str, tmp_path: Path) -> None:
    run = reinforce(tiny(name, steps=200), tmp_path / "run")
    before = model_state(run.model)
    run.model.learn(200, reset_num_timesteps=False)
    moved = model_state(run.model)
    assert any(not torch.equal(a, b) for part in before for a, b in zip(before[part], moved[part], strict=True))
    load_model_state(run.model, before)
    back = model_state(run.model)
    assert all(torch.equal(a, b) for part in before for a, b in zip(before[part], back[part], strict=True))
    with pytest.raises((LookupError, ValueError)):
        load_model_state(run.model, {part: values[1:] for part, values in before.items()})
    with pytest.raises(ConfigError, match="another process"):
        reinforce(tiny(name), tmp_path / "other", threads=2)


def test_numbers_that_are_not_finite_are_not_saved(tmp_path: Path) -> None:
    run = reinforce(tiny("sac", steps=200, **{"algorithm.ent_coef": 0}), tmp_path / "run")
    files = sorted((tmp_path / "run/checkpoints").iterdir())
    broken = model_state(run.model)
    broken["qf_state"] = [one * float("nan") if one.is_floating_point() else one for one in broken["qf_state"]]
    load_model_state(run.model, broken)
    with pytest.raises(RunError, match="not finite"):
        run.save()
    assert sorted((tmp_path / "run/checkpoints").iterdir()) == files


def test_a_run_ends_once_enough_is_solved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    solved = iter([1, 0, 1, 2, 1])  # of two episodes, every 80 steps
    monkeypatch.setattr(Run, "evaluate", lambda run: [(OBJECT, 2, next(solved))])
    changes = {
        "steps": 480,
        "evaluation.every": 80,
        "evaluation.success_threshold": 0.5,
        "evaluation.stop_after": 2,
    }
    state = reinforce(tiny("sac", **changes), tmp_path / "run").state
    assert (state.step, state.best_step, state.developed) == (320, 320, 320)
    assert reinforce(tiny("sac", **changes), tmp_path / "run").state.step == 320  # it has ended
    changes["evaluation.stop_after"] = 3
    assert reinforce(tiny("sac", **changes), tmp_path / "run").state.step == 400  # goes on, to the third in a row


def test_an_ended_run_goes_on_with_another_threshold(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Run, "evaluate", lambda run: [(OBJECT, 2, 1)])
    changes = {"steps": 320, "evaluation.every": 80, "evaluation.success_threshold": 0.5}
    assert reinforce(tiny("ppo", **changes), tmp_path / "run").state.step == 160
    assert reinforce(tiny("ppo", **changes | {"steps": 480}), tmp_path / "run").state.step == 160
    changes |= {"steps": 480, "evaluation.success_threshold": 1.0}
    assert reinforce(tiny("ppo", **changes), tmp_path / "run").state.step == 480


@pytest.mark.parametrize(("name", "ends"), [("sac", True), ("ppo", False)])
def test_success_ends_training_episodes_as_configured(name: str, ends: bool, tmp_path: Path) -> None:
    """Episodes of measurements end in any case."""
    assert load_reinforcement_config(name, TASK).terminate_on_success is ends
    for wanted in (True, False):
        run = reinforce(tiny(name, terminate_on_success=wanted), tmp_path / f"{wanted}")
        made: list[Any] = [run._scaled.unwrapped, run._make_env(2, is_evaluation=True)]
        assert [env._episodes.end_at_success for env in made] == [wanted, True]


def test_the_library_is_given_entropy_and_returns(tmp_path: Path) -> None:
    run = reinforce(tiny("sac", **{"algorithm.action_entropy": -0.5, "algorithm.n_steps": 2}), tmp_path / "run")
    assert run.model.target_entropy == -0.5 * 13
    assert run.model.replay_buffer.n_steps == 2


def test_critics_with_layer_norm(tmp_path: Path) -> None:
    plain, normed = (
        reinforce(tiny("sac", **{"algorithm.layer_norm": one}), tmp_path / str(one)) for one in (False, True)
    )
    count = [sum(leaf.numel() for leaf in model_state(run.model)["qf_state"]) for run in (plain, normed)]
    assert count[1] > count[0]


def test_the_policy_acts_as_the_library_does(tmp_path: Path) -> None:
    for name in ("sac", "ppo"):
        run = reinforce(tiny(name, steps=200), tmp_path / name)
        policy = load_run(tmp_path / name / LATEST)
        env = artiskill.ManipulationEnv(TASK, OBJECT, config=run.config.config)
        observation, info = env.reset(seed=5)
        policy.reset(observation, info)
        theirs = run.model.predict(run._normal.normalize_obs(observation[None]), deterministic=True)[0][0]
        np.testing.assert_allclose(policy.act(observation), theirs, atol=1e-5)
        with pytest.raises(ConfigError, match="states"):
            policy.act(observation[:-1])


def test_commands_train_evaluate_and_refuse(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "run"
    values = [f"{key}={value}" for key, value in (TINY | OWN["sac"]).items() if key != "objects"]
    command = ["train", "sac", "--task", TASK, "--objects", OBJECT, "--out", str(out), "--set", *values]
    assert main(command) == 0
    assert "of 2 episodes on new levels solved" in capsys.readouterr().out
    for name in ("config.yaml", "run.json", "metrics.csv", "development.csv", str(BEST), str(LATEST)):
        assert (out / name).is_file(), name
    measured = ["evaluate", "--policy", str(out), "--objects", OBJECT, "--target", "link_0", "--episodes", "2"]
    assert main([*measured, "--out", str(tmp_path / "report")]) == 0
    assert (tmp_path / "report/report.json").is_file()
    assert main([*command, "--points", "5"]) == 2
    assert main([*command, "algorithm.gama=1"]) == 2
    assert "gamma" in capsys.readouterr().err
    assert main([*command, "seed=1"]) == 2
    assert "other values" in capsys.readouterr().err
    assert main(["export-policy", str(out), str(tmp_path / "a.npz")]) == 2
    assert "from the state" in capsys.readouterr().err


def test_killed_runs_go_on(tmp_path: Path) -> None:
    out = tmp_path / "run"
    values = [f"{key}={value}" for key, value in (TINY | OWN["sac"]).items() if key not in ("objects", "steps")]
    command = [sys.executable, "-m", "artiskill", "train", "sac", "--task", TASK, "--objects", OBJECT]
    command += ["--out", str(out), "--steps", "100000000", "--set", *values]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=dict(os.environ))
    end = time.monotonic() + 120
    while not (out / LATEST).exists():
        assert process.poll() is None
        assert time.monotonic() < end
        time.sleep(0.05)
    process.send_signal(signal.SIGKILL)
    process.wait()
    stands = read_content(out / LATEST)["state"]["step"]
    steps = stands + 40
    config = tiny("sac", steps=100_000_000)
    starts: list[int] = []

    def stop(step: int, text: str) -> None:
        if step >= steps:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt, match="is saved"):
        reinforce(config, out, on_start=starts.append, on_step=stop)
    assert starts == [stands]
    assert read_content(out / LATEST)["state"]["step"] > stands


def test_a_signal_while_success_is_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A checkpoint is saved, and the measurement made again."""
    config = tiny("ppo", **{"evaluation.every": 200})
    reinforce(config, tmp_path / "whole")
    act_all = reinforcement.StatePolicy.act_all

    def interrupted(policy: Any, observations: Any) -> Any:
        signal.raise_signal(signal.SIGINT)
        return act_all(policy, observations)

    with monkeypatch.context() as patch:
        patch.setattr(reinforcement.StatePolicy, "act_all", interrupted)
        with pytest.raises(KeyboardInterrupt, match="interrupted after step 240, which is saved"):
            reinforce(config, tmp_path / "begun")
    reinforce(config, tmp_path / "begun")
    assert equal(weights(tmp_path / "whole"), weights(tmp_path / "begun"))
    found = [(tmp_path / name / "development.csv").read_bytes() for name in ("whole", "begun")]
    assert found[0] == found[1]


def test_each_object_is_measured(tmp_path: Path) -> None:
    objects = [OBJECT, "cabinet-0002", "cabinet-0007"]  # of two episodes that are asked for
    run = reinforce(tiny("ppo", objects=objects, target=None, steps=80), tmp_path)
    assert run.episodes == 3
    rows = Table(tmp_path / "development.csv", 10**9).rows
    assert [(row["object"], row["episodes"]) for row in rows] == [(name, "1") for name in objects]
    assert Table(tmp_path / "metrics.csv", 10**9).rows, "also of a run that is shorter than `log_every`"


def test_damaged_and_foreign_folders_are_refused(tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    (tmp_path / "other/file").touch()
    with pytest.raises(RunError, match="holds no training run"):
        reinforce(tiny("ppo"), tmp_path / "other")
    reinforce(tiny("ppo", steps=100), tmp_path / "run")
    with pytest.raises(RunError, match="a run of ppo"):
        reinforce(tiny("sac", steps=100), tmp_path / "run")
    next((tmp_path / "run/checkpoints").glob("going-on-*")).write_bytes(b"no pickle")
    with pytest.raises(RunError, match="damaged"):
        reinforce(tiny("ppo", steps=400), tmp_path / "run")
    (tmp_path / "run" / BEST).write_bytes(b"nothing")
    with pytest.raises(PolicyError, match="damaged"):
        load_run(tmp_path / "run")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"algorithm.gamma": 2}, "gamma"),
        ({"algorithm.ent_coef": "automatic"}, "ent_coef"),
        ({"algorithm.ent_coef": -0.1}, "ent_coef"),
        ({"algorithm.ent_coef": "auto_x"}, "ent_coef"),
        ({"algorithm.action_entropy": 0.7}, "action_entropy"),
        ({"algorithm.n_steps": 0}, "n_steps"),
        ({"algorithm.expert_share": 1.5}, "expert_share"),
        ({"algorithm.takeover_steps": [20, 10]}, "takeover_steps"),
        ({"evaluation.success_threshold": 1.1}, "success_threshold"),
        ({"evaluation.stop_after": -1}, "stop_after"),
        ({"envs": 0}, "envs must be"),
        ({"objects": []}, "objects"),
        ({"reward_scale": 0}, "reward_scale"),
    ],
)
def test_illegal_values_are_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        tiny("sac", **changes)


def test_what_is_refused_leaves_no_run_behind(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="unknown target link 'link_9'"):
        reinforce(tiny("ppo", target="link_9"), tmp_path)
    reinforce(tiny("ppo", steps=100), tmp_path)


def test_a_policy_that_is_told_where_the_handle_is(tmp_path: Path) -> None:
    """Evaluations and demonstrations show it what it learned from; the latter are of the usual task."""
    plain, told = tiny("ppo", steps=100, **{"config.state.handle": False}), tiny("ppo", steps=100)
    sizes = []
    for config, folder in ((plain, tmp_path / "plain"), (told, tmp_path / "told")):
        reinforce(config, folder)
        policy = load_run(folder)
        sizes.append(policy._mean.numel())  # type: ignore[union-attr]
    assert sizes[1] == sizes[0] + 23
    assert policy.observation_config == {"state": {"handle": True}}
    measured = ["evaluate", "--policy", str(tmp_path / "told"), "--objects", OBJECT, "--episodes", "1"]
    assert main([*measured, "--out", str(tmp_path / "report"), "--workers", "1"]) == 0
    assert main(["report", "verify", str(tmp_path / "report"), "--workers", "1"]) == 0
    collect = ["demos", "collect", "--task", TASK, "--objects", OBJECT, "--per-object", "1", "--workers", "1"]
    given = ["--policy", str(tmp_path / "told"), "--out", str(tmp_path / "demos"), "--set", "episode_steps=3"]
    assert main([*collect, *given]) == 1, "it acts, and solves nothing"
    assert not Demos(tmp_path / "demos").manifest.settings.config["state"]["handle"]
    with pytest.raises(ConfigError, match="unknown key 'handel'"):
        reinforce(tiny("ppo", **{"config.state.handel": True}), tmp_path / "wrong")
    assert not (tmp_path / "wrong" / "run.json").exists()


def test_agents_demonstrate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Here every state counts as solved."""
    values = [f"{key}={value}" for key, value in (TINY | OWN["ppo"]).items() if key not in ("objects", "target")]
    run, out = str(tmp_path / "run"), str(tmp_path / "demos")
    chair = ["--task", "PushChair", "--objects", "chair-0002"]
    assert main(["train", "ppo", *chair, "--out", run, "--set", *values, "steps=100"]) == 0
    easy = {"near_m": 9, "max_tilt_rad": 3, "max_speed_m_s": 99, "max_angular_speed_rad_s": 99, "hold_s": 0.1}
    changed = [f"success.{key}={value}" for key, value in easy.items()]
    collect = ["demos", "collect", *chair, "--per-object", "2", "--out", out, "--policy", run, "--workers", "1"]
    assert main([*collect, "--set", *changed]) == 0
    assert main(["demos", "verify", out, "--workers", "1"]) == 0
    expert = Demos(Path(out)).manifest.settings.expert
    assert (expert.kind, expert.name) == ("agent", "ppo")
    capsys.readouterr()
    assert main([*collect, "--ray", "auto"]) == 2
    assert main(["demos", "collect", "--task", TASK, "--out", out, "--policy", run]) == 2
    assert "learned PushChair" in capsys.readouterr().err
