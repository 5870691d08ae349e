"""Models of reinforcement learning: what SBX trains, Stable-Baselines3's JAX sibling, and what is kept of them.

SBX has the algorithms and the interface of Stable-Baselines3. On one core its SAC makes updates 2.3 times as fast
(`docs/reinforcement_learning.md`).
"""

import os
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import numpy as np
import torch
from sbx import PPO, SAC

from artiskill.errors import RunError
from artiskill.learning.reinforcement_config import ReinforcementConfig

_KINDS = {"sac": SAC, "ppo": PPO}
_STATES = {"sac": ("actor_state", "qf_state"), "ppo": ("actor_state", "vf_state")}  # of the policy
_OF_POLICY = ("log_std_init",)  # values that the policy takes, not the algorithm
_ONE_THREAD = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"


def use_threads(count: int) -> None:
    """Let JAX use so many threads of the CPU: one, or as many as it likes. Later calls in a process do nothing."""
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    flags = os.environ.get("XLA_FLAGS", "")
    if count == 1 and _ONE_THREAD not in flags:
        os.environ["XLA_FLAGS"] = f"{flags} {_ONE_THREAD}".strip()


def make_model(config: ReinforcementConfig, env: Any) -> Any:
    """Return a model with initial weights, which learns in an environment of Stable-Baselines3."""
    values = dict(vars(config.values))
    policy: dict[str, Any] = {"net_arch": list(values.pop("net_arch"))}
    policy |= {name: values.pop(name) for name in _OF_POLICY if name in values}
    if config.name == "ppo":
        policy["ortho_init"] = True
    return _KINDS[config.name]("MlpPolicy", env, policy_kwargs=policy, seed=config.seed, **values)


def count_parameters(model: Any) -> int:
    """Return how many weights a model's policy and critics have."""
    states = (getattr(model.policy, name) for name in _names(model))
    return sum(leaf.size for state in states for leaf in jax.tree.leaves(state.params))


def layers(model: Any) -> tuple[list[torch.Tensor], list[torch.Tensor]]:
    """Return weights (out, in) and biases of the layers that lead from observations to mean actions."""
    parameters = model.policy.actor_state.params["params"]
    count = sum(name.startswith("Dense_") for name in parameters) - ("log_std" not in parameters)  # SAC's own
    found: tuple[list[torch.Tensor], list[torch.Tensor]] = ([], [])
    for number in range(count):
        dense = parameters[f"Dense_{number}"]
        for values, one in zip(found, (np.transpose(dense["kernel"]), dense["bias"]), strict=True):
            values.append(torch.from_numpy(np.array(one)))
    return found


def pack(model: Any) -> dict[str, list[torch.Tensor]]:
    """Return all that a model has learned, its optimizers and its generators' keys, as `unpack` takes it.

    Raises:
        RunError: a number is not finite.
    """
    found = {name: [_to_tensor(leaf) for leaf in jax.tree.leaves(tree)] for name, tree in _trees(model).items()}
    for name, leaves in found.items():
        if not all(leaf.isfinite().all() for leaf in leaves):
            raise RunError(f"numbers of {name} are not finite after step {model.num_timesteps}")
    return found


def unpack(model: Any, packed: Mapping[str, Sequence[torch.Tensor]]) -> None:
    """Put a model where it was when it was packed.

    Raises:
        LookupError, ValueError: it was another model.
    """
    trees = {}
    for name, tree in _trees(model).items():
        leaves, shape = jax.tree.flatten(tree)
        values = [
            jax.numpy.asarray(value.numpy().reshape(np.shape(leaf)), dtype=jax.numpy.asarray(leaf).dtype)
            for leaf, value in zip(leaves, packed[name], strict=True)
        ]
        trees[name] = jax.tree.unflatten(shape, values)
    for name in _names(model):
        setattr(model.policy, name, trees[name])
    model.key, model.policy.key, model.policy.noise_key = trees["keys"]
    if "ent_coef_state" in trees:
        model.ent_coef_state = trees["ent_coef_state"]


def _names(model: Any) -> tuple[str, ...]:
    return next(_STATES[name] for name, kind in _KINDS.items() if isinstance(model, kind))


def _trees(model: Any) -> dict[str, Any]:
    found = {name: getattr(model.policy, name) for name in _names(model)}
    found["keys"] = [model.key, model.policy.key, model.policy.noise_key]
    if hasattr(model, "ent_coef_state"):
        found["ent_coef_state"] = model.ent_coef_state
    return found


def _to_tensor(leaf: Any) -> torch.Tensor:
    value = np.asarray(leaf)
    is_whole = np.issubdtype(value.dtype, np.integer)
    return torch.from_numpy(np.array(value, dtype=np.int64 if is_whole else np.float32))
