"""LeRobot itself makes the environments and plays in them; `make test-lerobot` has its versions."""

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.demos.test_lerobot_library import load_lerobot

from artiskill.evaluation.report import Report

from .conftest import LEVELS, OBJECTS, TASK

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("default")]
ENV_HUB = Path(__file__).parents[2] / "plugins" / "envhub" / "env.py"
SMALL = "{cameras.width: 64, cameras.height: 32, episode_steps: 60}"
OPTIONS = {"task": TASK, "objects": ",".join(OBJECTS), "config": SMALL}


@pytest.fixture(scope="module")
def plugin(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The plugin, found as LeRobot finds it."""
    load_lerobot()
    if importlib.util.find_spec("lerobot_env_artiskill") is None:
        pytest.skip("the plugin is not installed")
    from lerobot.configs.parser import load_plugin

    load_plugin("lerobot_env_artiskill")  # --env.discover_packages_path
    from lerobot.envs.configs import EnvConfig

    return EnvConfig.get_choice_class("artiskill")


@pytest.fixture(autouse=True)
def offline(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")


def evaluation_of(envs: Any, policy: Any, episodes: int) -> Any:
    """What LeRobot's own evaluation says."""
    from lerobot.processor.pipeline import PolicyProcessorPipeline
    from lerobot.scripts.lerobot_eval import eval_policy_all

    nothing = [PolicyProcessorPipeline(steps=[]) for _ in range(3)]
    actions = PolicyProcessorPipeline(
        steps=[], to_transition=lambda action: {"action": action}, to_output=lambda found: found["action"]
    )
    return eval_policy_all(envs, policy, *nothing, actions, n_episodes=episodes, start_seed=0)


def replaying(report: Report) -> Any:
    """A policy that acts as the expert did, level by level of each object in turn."""
    import torch
    from lerobot.policies.act.configuration_act import ACTConfig
    from lerobot.policies.pretrained import PreTrainedPolicy

    class Replaying(PreTrainedPolicy):
        config_class, name = ACTConfig, "replaying"

        def __init__(self) -> None:
            super().__init__(ACTConfig(device="cpu"))
            self.rollouts, self.seen = -1, []

        def reset(self) -> None:
            self.rollouts, self.steps = self.rollouts + 1, 0

        def select_action(self, batch: dict[str, Any]) -> Any:
            self.seen.append({key: getattr(value, "shape", value) for key, value in batch.items()})
            episodes = report.episodes[LEVELS * self.rollouts : LEVELS * (self.rollouts + 1)]
            rows = [e.actions[min(self.steps, len(e.actions) - 1)] for e in episodes]
            self.steps += 1
            return torch.from_numpy(np.array(rows))

        get_optim_params = forward = predict_action_chunk = None

    return Replaying()


def test_success_is_that_of_an_evaluation(plugin: Any, report: Report) -> None:
    """Of environments of each object, as LeRobot 0.6 makes them, and as env.py of EnvHub does."""
    envs = plugin(**OPTIONS).create_envs(LEVELS)
    policy = replaying(report)
    found = evaluation_of(envs, policy, LEVELS)
    successes = [task["metrics"]["successes"] for task in found["per_task"]]
    assert [one for task in successes for one in task] == [episode.success for episode in report.episodes]
    assert any(map(any, successes))
    seen = policy.seen[0]
    assert seen["observation.state"] == (LEVELS, 38)
    names = [f"{camera}{kind}" for camera in ("front", "left", "right") for kind in ("", "_masks")]
    assert {key: seen[f"observation.images.{key}"] for key in names} == dict.fromkeys(names, (LEVELS, 3, 32, 64))
    assert seen["task"] == ["Open the marked drawer of the cabinet."] * LEVELS


def test_make_env_and_one_of_its_networks(plugin: Any) -> None:
    """`make_env` of 0.4; the features say what a policy of LeRobot needs to know."""
    import torch
    from lerobot.envs.factory import make_env
    from lerobot.policies.act.configuration_act import ACTConfig
    from lerobot.policies.factory import make_policy

    config = plugin(**OPTIONS | {"config": SMALL.replace("60", "3")})
    envs = make_env(config, n_envs=2)
    ((name, ((number, env),)),) = ((name, tuple(one.items())) for name, one in envs.items())
    assert (name, number, env.num_envs, env.metadata["autoreset_mode"].value) == ("artiskill", 0, 2, "SameStep")
    torch.manual_seed(0)
    small: dict[str, Any] = {"dim_model": 16, "n_heads": 2, "dim_feedforward": 16, "chunk_size": 4}
    wanted = ACTConfig(device="cpu", pretrained_backbone_weights=None, n_action_steps=4, use_vae=False, **small)
    policy = make_policy(wanted, env_cfg=config)
    assert policy.config.action_feature.shape == (13,)
    assert len(policy.config.image_features) == 6
    found = evaluation_of(envs, policy, 2)
    assert found["overall"]["n_episodes"] == 2
    assert found["overall"]["pc_success"] == 0.0
    env.close()


def test_env_hub(plugin: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only the download is left out."""
    import lerobot.envs.factory as factory

    def downloaded(*arguments: object) -> tuple[str, str, str, None]:
        return "somebody/artiskill", "env.py", str(ENV_HUB), None

    monkeypatch.setattr(factory, "_download_hub_file", downloaded)
    envs = factory.make_env("somebody/artiskill", n_envs=1, trust_remote_code=True)
    assert list(envs) == ["OpenCabinetDrawer"]
    assert len(envs["OpenCabinetDrawer"]) == 10
    observation, _ = envs["OpenCabinetDrawer"][3].reset(seed=0)
    assert observation["pixels"]["front"].shape == (1, 160, 400, 3)
