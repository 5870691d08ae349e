"""ArtiSkill's tasks for LeRobot: `--env.type=artiskill`.

LeRobot imports this package by its distribution's name (0.6), or by `--env.discover_packages_path` (0.4).
"""

from dataclasses import dataclass
from typing import Any

import gymnasium as gym
from lerobot.configs.types import FeatureType, PolicyFeature
from lerobot.envs.configs import EnvConfig

from artiskill.compat.lerobot import SUITE, LeRobotEnv, make_envs
from artiskill.files import parse_yaml

ENV_ID = "lerobot_env_artiskill/ArtiSkill-v0"
_IMAGES = "pixels/"


@EnvConfig.register_subclass("artiskill")
@dataclass
class ArtiSkillEnvConfig(EnvConfig):
    """One task over objects; see `LeRobotEnv`."""

    task: str | None = SUITE
    fps: int = 20
    objects: str = "test"  # splits or ids, separated by commas
    target: str | None = None
    obs_mode: str = "rgbd"
    control_mode: str = "joint"
    render_mode: str = "rgb_array"
    config: str = "{}"  # values of the task to change, as YAML: "{cameras.width: 128}"
    sampling: str = "null"  # of points, as YAML: "{num_points: 1200, frame: robot}"

    def __post_init__(self) -> None:
        """Say what policies see and do."""
        env = LeRobotEnv(**self.gym_kwargs)
        spaces: dict[str, Any] = dict(env.observation_space)
        pixels = spaces.pop("pixels", {})
        env.close()
        self.features |= {
            "action": PolicyFeature(FeatureType.ACTION, env.action_space.shape),
            "agent_pos": PolicyFeature(FeatureType.STATE, spaces["agent_pos"].shape),
            **{_IMAGES + name: PolicyFeature(FeatureType.VISUAL, space.shape) for name, space in pixels.items()},
        }
        self.features_map |= {
            "action": "action",
            "agent_pos": "observation.state",
            **{_IMAGES + name: f"observation.images.{name}" for name in pixels},
        }

    @property
    def package_name(self) -> str:
        """Where LeRobot 0.4 looks for the environment."""
        return __name__

    @property
    def gym_id(self) -> str:
        """The id of all tasks' environment."""
        return ENV_ID

    @property
    def gym_kwargs(self) -> dict[str, Any]:
        """The arguments of `LeRobotEnv`."""
        return {
            "task": self.task or SUITE,
            "objects": [name.strip() for name in self.objects.split(",")],
            "target": self.target,
            "obs_mode": self.obs_mode,
            "control_mode": self.control_mode,
            "render_mode": self.render_mode,
            "config": parse_yaml(self.config),
            "sampling": parse_yaml(self.sampling),
        }

    def create_envs(self, n_envs: int, use_async_envs: bool = False) -> dict[str, dict[int, Any]]:
        """Return environments of every object, as LeRobot 0.6 asks for them."""
        return make_envs(n_envs, use_async_envs and n_envs > 1, **self.gym_kwargs)


# wrappers would hide `task_description`, which LeRobot asks the environment for
gym.register(ENV_ID, LeRobotEnv, order_enforce=False, disable_env_checker=True)
