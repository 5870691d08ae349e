"""Checkpoints of reinforcement learning, from which a run goes on with the same bits.

A checkpoint is two files: `latest.pt`, weights and optimizers, and beside it `going-on-<step>.pkl`: the replay
buffer, the environments and the generators. The second is written first; the first names the step, so that a run
that is killed in between goes on from the checkpoint before.
"""

import pickle
import random
from pathlib import Path
from typing import Any

import numpy as np
import torch

from artiskill.errors import RunError
from artiskill.learning.checkpoints import TrainState, read_content, write_content
from artiskill.learning.reinforcement_models import load_model_state, model_state
from artiskill.learning.run import LATEST, write_whole

_BUFFER = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")
_COUNTERS: tuple[str, ...] = ("num_timesteps", "_n_updates", "_episode_num")
_COUNTERS += ("_last_obs", "_last_original_obs", "_last_episode_starts")


def write_checkpoint(
    folder: Path,
    state: TrainState,
    acting: dict[str, Any],
    model: Any,
    env: Any,
) -> None:
    """Write where a run stands.

    Args:
        folder: of the run.
        state: of the run.
        acting: what `StatePolicy` needs.
        model: that learns.
        env: vector of environments that it learns in.

    Raises:
        OSError: it cannot be written; the checkpoint before is as it was.
        RunError: a weight is not finite.
    """
    learned = model_state(model)  # first: nothing is written where numbers are not finite
    buffer = getattr(model, "replay_buffer", None)
    expert = getattr(model, "expert", None)
    scaling = model.get_vec_normalize_env()
    going_on = {
        "env": env,
        "counters": {name: getattr(model, name, None) for name in _COUNTERS},
        "normal": scaling.obs_rms if scaling.norm_obs else None,
        "generators": (random.getstate(), np.random.get_state(), torch.get_rng_state()),  # noqa: NPY002 - the library's
        "warm_up": model.action_space.np_random.bit_generator.state,
    }
    if expert is not None:
        going_on["expert"] = expert.state
    if buffer is not None:
        count = len(buffer.observations) if buffer.full else buffer.pos
        going_on["buffer"] = {name: getattr(buffer, name)[:count] for name in _BUFFER}
        going_on["place"] = buffer.pos, buffer.full
    path = folder / LATEST
    # into the file: a replay buffer of a million steps is nearly a gigabyte
    write_whole(_beside(path, state.step), lambda file: pickle.dump(going_on, file, protocol=5))
    write_content(path, {"state": dict(vars(state)), "acting": acting, "model": learned})
    for old in path.parent.glob("going-on-*.pkl"):
        if old != _beside(path, state.step):
            old.unlink()


def read_checkpoint(folder: Path) -> tuple[TrainState, dict[str, Any]]:
    """Return the state of a run, and what `restore` takes; `env` of it is the environments.

    Raises:
        RunError: the checkpoint is damaged, cannot be read, or is of an older version.
    """
    path = folder / LATEST
    content = read_content(path)
    if "model" not in content:
        raise RunError(f"{str(path)!r} was trained by torch, before SBX: train anew, in another folder")
    try:
        state = TrainState(**content["state"])
        with _beside(path, state.step).open("rb") as file:
            going_on: dict[str, Any] = pickle.load(file)
    except OSError as error:
        raise RunError(f"cannot read {str(path.parent)!r}: {error.strerror}: {error.filename}") from error
    except (pickle.UnpicklingError, EOFError, LookupError, TypeError, AttributeError, ValueError) as error:
        raise RunError(f"the checkpoint in {str(path.parent)!r} is damaged") from error
    return state, content | going_on


def restore(model: Any, saved: dict[str, Any]) -> None:
    """Put a model where it was, and the generators of this process.

    Raises:
        RuntimeError, LookupError, TypeError, ValueError: it was another model.
    """
    load_model_state(model, saved["model"])
    for name, value in saved["counters"].items():
        setattr(model, name, value)
    if "buffer" in saved:
        for name, values in saved["buffer"].items():
            getattr(model.replay_buffer, name)[: len(values)] = values
        model.replay_buffer.pos, model.replay_buffer.full = saved["place"]
    if saved["normal"] is not None:
        model.get_vec_normalize_env().obs_rms = saved["normal"]
    if "expert" in saved:
        model.expert.state = saved["expert"]
    model.action_space.np_random.bit_generator.state = saved["warm_up"]
    python, numpy, tensors = saved["generators"]  # last: all above may draw
    random.setstate(python)
    np.random.set_state(numpy)  # noqa: NPY002 - the library's
    torch.set_rng_state(tensors)


def _beside(path: Path, step: int) -> Path:
    return path.with_name(f"going-on-{step}.pkl")
