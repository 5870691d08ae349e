"""Models of reinforcement learning: what SBX trains, Stable-Baselines3's JAX sibling, and what is kept of them.

SBX has the algorithms, names and interface of Stable-Baselines3, and is faster on a CPU
(`benchmarks/reinforcement.py`). Its PPO differs: actor and critic have optimizers of their own, each with its own
limit on gradients.
"""

import os
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import numpy as np
import torch
from sbx import PPO, SAC

from artiskill.errors import ConfigError, RunError
from artiskill.learning.expert_takeover import ExpertTakeover
from artiskill.learning.reinforcement_config import ReinforcementConfig


class GuidedSAC(SAC):
    """SBX's, but for what an expert does in some episodes.

    Attributes:
        expert: who takes over in them; None: nobody.
    """

    expert: ExpertTakeover | None = None

    def _sample_action(self, *args: Any, **kwargs: Any) -> tuple[np.ndarray, np.ndarray]:
        """Return actions to take, and to store; both lie in [-1, 1]."""
        actions, stored = super()._sample_action(*args, **kwargs)
        if self.expert is None:
            return actions, stored
        replaced = self.expert.replace(actions)
        return replaced, np.where(self.expert.has_taken_over[:, None], replaced, stored)

    def _store_transition(
        self, replay_buffer: Any, buffer_action: Any, new_obs: Any, reward: Any, dones: Any, infos: Any
    ) -> None:
        super()._store_transition(replay_buffer, buffer_action, new_obs, reward, dones, infos)
        if self.expert is not None:
            self.expert.advance(dones)


_KINDS = {"sac": GuidedSAC, "ppo": PPO}
_STATES = {"sac": ("actor_state", "qf_state"), "ppo": ("actor_state", "vf_state")}  # of the policy
_threads: int | None = None  # of this process: JAX takes the number once, when it begins


def use_threads(count: int) -> None:
    """Let JAX compute on so many threads of the CPU, and on no GPU. The number changes the last bits of sums.

    Raises:
        ConfigError: this process has begun with another number.
    """
    global _threads
    if _threads not in (None, count):
        raise ConfigError(f"this process trains with {_threads} threads: for {count}, begin another process")
    os.environ["NPROC"] = str(count)  # by default all cores, so bits would depend on the machine
    jax.config.update("jax_platforms", "cpu")
    _threads = count


def make_model(config: ReinforcementConfig, env: Any, kinds: Mapping[str, Any] = _KINDS) -> Any:
    """Return a model with initial weights, which learns in an environment of Stable-Baselines3.

    Args:
        config: of the run.
        env: to learn in.
        kinds: name -> class, of SBX or of Stable-Baselines3, whose models take the same values.
    """
    values = dict(vars(config.values))
    policy: dict[str, Any] = {"net_arch": list(values.pop("net_arch"))}
    if values.pop("layer_norm", False):
        policy["layer_norm"] = True  # an option of SBX alone
    if config.name == "ppo":  # first actions are near 0, as Stable-Baselines3 has it
        policy |= {"log_std_init": values.pop("log_std_init"), "ortho_init": True}
    for name in ("expert_share", "takeover_steps"):
        values.pop(name, None)
    if "action_entropy" in values:
        values["target_entropy"] = values.pop("action_entropy") * env.action_space.shape[0]
    if not isinstance(values["ent_coef"], str):
        values["ent_coef"] = float(values["ent_coef"])  # SBX takes no whole number
    return kinds[config.name]("MlpPolicy", env, policy_kwargs=policy, seed=config.seed, **values)


def count_parameters(model: Any) -> int:
    """Return how many weights a model's policy and critics have."""
    states = (getattr(model.policy, name) for name in _state_names(model))
    return sum(leaf.size for state in states for leaf in jax.tree.leaves(state.params))


def actor_layers(model: Any) -> tuple[list[torch.Tensor], list[torch.Tensor]]:
    """Return weights (out, in) and biases of the layers that lead from observations to mean actions."""
    parameters = model.policy.actor_state.params["params"]
    count = sum(name.startswith("Dense_") for name in parameters) - ("log_std" not in parameters)  # SAC's own
    found: tuple[list[torch.Tensor], list[torch.Tensor]] = ([], [])
    for number in range(count):
        dense = parameters[f"Dense_{number}"]
        for values, one in zip(found, (np.transpose(dense["kernel"]), dense["bias"]), strict=True):
            values.append(torch.from_numpy(np.array(one)))
    return found


def model_state(model: Any) -> dict[str, list[torch.Tensor]]:
    """Return all that a model has learned, its optimizers and its generators' keys: see `load_model_state`.

    Raises:
        RunError: a number is not finite.
    """
    found = {name: [_to_tensor(leaf) for leaf in jax.tree.leaves(tree)] for name, tree in _trees(model).items()}
    for name, leaves in found.items():
        if not all(leaf.isfinite().all() for leaf in leaves):
            raise RunError(f"numbers of {name} are not finite after step {model.num_timesteps}")
    return found


def load_model_state(model: Any, state: Mapping[str, Sequence[torch.Tensor]]) -> None:
    """Put a model where it was.

    Raises:
        LookupError, ValueError: it was another model.
    """
    trees = {}
    for name, tree in _trees(model).items():
        leaves, shape = jax.tree.flatten(tree)
        values = [
            jax.numpy.asarray(value.numpy().reshape(np.shape(leaf)), dtype=jax.numpy.asarray(leaf).dtype)
            for leaf, value in zip(leaves, state[name], strict=True)
        ]
        trees[name] = jax.tree.unflatten(shape, values)
    for name in _state_names(model):
        setattr(model.policy, name, trees[name])
    model.key, model.policy.key, model.policy.noise_key = trees["keys"]
    if "ent_coef_state" in trees:
        model.ent_coef_state = trees["ent_coef_state"]


def _state_names(model: Any) -> tuple[str, ...]:
    return next(_STATES[name] for name, kind in _KINDS.items() if isinstance(model, kind))


def _trees(model: Any) -> dict[str, Any]:
    found = {name: getattr(model.policy, name) for name in _state_names(model)}
    found["keys"] = [model.key, model.policy.key, model.policy.noise_key]
    if hasattr(model, "ent_coef_state"):
        found["ent_coef_state"] = model.ent_coef_state
    return found


def _to_tensor(leaf: Any) -> torch.Tensor:
    value = np.asarray(leaf)
    is_whole = np.issubdtype(value.dtype, np.integer)
    return torch.from_numpy(np.array(value, dtype=np.int64 if is_whole else np.float32))
