"""ArtiSkill for LeRobot's EnvHub: the file `env.py` of a repository on the Hugging Face Hub.

make_env("somebody/artiskill", n_envs=4, trust_remote_code=True)
"""

from typing import Any

from artiskill.compat.lerobot import SUITE, make_envs


def make_env(n_envs: int = 1, use_async_envs: bool = False, cfg: Any = None) -> Any:
    """Return environments of every test object; `cfg.task` names the task."""
    task = getattr(cfg, "task", None) or SUITE
    return make_envs(n_envs, use_async_envs, task=task)
