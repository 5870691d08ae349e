"""The benchmark as vla-eval loads and plays it, with the real package where it is installed: `make test-doors`."""

import importlib.util
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from artiskill.compat import vla_eval as adapter
from artiskill.errors import ConfigError, MissingExtraError
from artiskill.evaluation.report import Report

from .conftest import LEVELS, OBJECTS, TASK

IMPORT_STRING = "artiskill.compat.vla_eval:ArtiSkillBenchmark"
SMALL = {"cameras.width": 32, "cameras.height": 16, "episode_steps": 60}
pytestmark = pytest.mark.filterwarnings("default")
needs_vla_eval = pytest.mark.skipif(
    importlib.util.find_spec("vla_eval") is None, reason="needs the extra `vla`: make test-doors"
)


def test_without_the_package_an_error_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    adapter._benchmark_class.cache_clear()
    monkeypatch.setitem(sys.modules, "vla_eval.benchmarks.base", None)
    with pytest.raises(MissingExtraError, match=r"artiskill\[vla\]"):
        _ = adapter.ArtiSkillBenchmark
    with pytest.raises(AttributeError, match="public: ArtiSkillBenchmark"):
        _ = adapter.Benchmark


@needs_vla_eval
@pytest.mark.parametrize("obs_mode", ["rgbd", "pointcloud", "state"])
@pytest.mark.parametrize("task", ["OpenCabinetDoor", "PushChair"])
def test_specs_say_what_observations_and_actions_are(task: str, obs_mode: str) -> None:
    from vla_eval.benchmarks.base import StepBenchmark
    from vla_eval.render import apply_render_mode
    from vla_eval.specs import check_specs

    made = adapter.ArtiSkillBenchmark([task], "train", obs_mode=obs_mode, config=SMALL)
    assert isinstance(made, StepBenchmark)
    assert apply_render_mode(type(made), "cpu", "ArtiSkill") == {}
    made._recorder = Silent()
    raw = made.reset({"name": task, "episode_idx": 3})
    observation = made.make_obs(raw, {"name": task})
    spec, actions = made.get_observation_spec(), made.get_action_spec()
    assert not check_specs(actions, actions, spec, spec)
    assert spec["state"].dims == len(observation["state"])
    assert set(spec) - {"state", "language", "pointcloud"} == set(observation.get("images", {}))
    size = sum(part.dims for part in actions.values())
    assert size == made._env.control.size
    last = np.arange(size, dtype=np.float32)
    held = made.get_hold_action({"actions": last})["actions"]
    assert held[11:13].tolist() == [11, 12]
    assert np.count_nonzero(held) == 2 * (size // 11)
    made.step(made.get_hold_action(None))
    made.cleanup()


class Silent:
    """A recorder that keeps nothing."""

    def record_video(self, frame: Any) -> None:
        assert frame is None or frame.dtype == np.uint8

    def record_step(self, **fields: Any) -> None:
        assert set(fields) <= adapter.ArtiSkillBenchmark._ALL_RECORD_FIELDS


@needs_vla_eval
@pytest.mark.parametrize("tasks", ["OpenCabinetDrawer", []])
def test_tasks_are_a_list(tasks: Any) -> None:
    with pytest.raises(ConfigError, match="must be a list of names"):
        adapter.ArtiSkillBenchmark(tasks)


@needs_vla_eval
def test_the_library_finds_the_success_that_an_evaluation_finds(report: Report, tmp_path: Path) -> None:
    """Its orchestrator loads the class by name and plays over a socket against a model server of its own."""
    from vla_eval.api import evaluate
    from vla_eval.model_servers.predict import PredictModelServer

    told: list[dict[str, Any]] = []

    class Replaying(PredictModelServer):
        async def on_episode_start(self, config: dict[str, Any], ctx: Any) -> None:
            await super().on_episode_start(config, ctx)
            told.append(dict(config["task"]))

        def predict(self, obs: dict[str, Any], ctx: Any) -> dict[str, Any]:
            episode_idx = told[-1]["episode_idx"]
            if ctx.is_first:
                told[-1] |= {"keys": sorted(obs), "images": sorted(obs["images"])}
            number, level = episode_idx % len(OBJECTS), episode_idx // len(OBJECTS)
            return {"actions": report.episodes[LEVELS * number + level].actions[ctx.step]}

        def get_action_spec(self) -> dict[str, Any]:
            return {}

        def get_observation_spec(self) -> dict[str, Any]:
            return {}

    entry = {
        "benchmark": IMPORT_STRING,
        "episodes_per_task": LEVELS * len(OBJECTS),
        "params": {"tasks": [TASK], "objects": OBJECTS, "config": SMALL},
    }
    config = {"render": "cpu", "output_dir": str(tmp_path), "benchmarks": [entry]}
    (found,) = evaluate(Replaying(), config, no_save=True)
    (task,) = found["tasks"]
    episodes = sorted(task["episodes"], key=lambda episode: episode["episode_id"])
    order = [LEVELS * number + level for level in range(LEVELS) for number in range(len(OBJECTS))]
    known = [report.episodes[k] for k in order]
    assert [e["metrics"]["success"] for e in episodes] == [e.success for e in known]
    assert [e["steps"] for e in episodes] == [e.length for e in known]
    assert any(e.success for e in known)
    assert all(set(e["metrics"]) == {"success", *known[0].flags} for e in episodes)
    assert [sorted(entry) for entry in told] == [["episode_idx", "images", "keys", "name", "suite"]] * len(known)
    assert told[0]["keys"] == ["images", "state", "task_description"]
    assert told[0]["images"] == sorted(
        f"{camera}{kind}" for camera in ("front", "left", "right") for kind in ("", "_masks")
    )
