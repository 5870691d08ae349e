"""Where the time of reinforcement learning goes: simulation, updates, an expert, the rest.

Runs have the defaults of their task. "Alone" is what one core does that simulates and updates, and nothing else.
Beside it, updates of the same sizes by Stable-Baselines3, which has them in torch. It does not normalise
critics, so neither side does there. Seconds are those of the CPU.
"""

import argparse
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from time import process_time
from types import SimpleNamespace
from unittest.mock import patch

import numpy as np
import sbx
import stable_baselines3
import torch

from artiskill.envs.vector_env import ManipulationVectorEnv
from artiskill.learning import reinforcement
from artiskill.learning.expert_takeover import ExpertTakeover
from artiskill.learning.reinforcement import Run, reinforce
from artiskill.learning.reinforcement_config import ReinforcementConfig, load_reinforcement_config
from artiskill.learning.reinforcement_models import make_model


def simulation_rate(config: ReinforcementConfig, seconds: float) -> float:
    """Steps per second of the environments alone, with random actions."""
    env = ManipulationVectorEnv(
        config.envs,
        config.task,
        list(config.objects),
        target=config.target,
        config=config.config,
        num_threads=1,
        autoreset_mode="same_step",
        terminate_on_success=config.terminate_on_success,
        copy=False,
    )
    env.reset(seed=0)
    rng, steps, start = np.random.default_rng(0), 0, process_time()
    shape = (config.envs, env.control.size)
    while process_time() - start < seconds:
        env.step(rng.uniform(-1, 1, shape).astype(np.float32))
        steps += config.envs
    return steps / (process_time() - start)


def update_seconds(run: Run | SimpleNamespace, seconds: float) -> float:
    """Seconds of updates for each environment step, with nothing else in between."""
    values, iteration = run.config.values, run.config.envs
    count, start = 0, process_time()
    while process_time() - start < seconds:
        if run.config.name == "sac":
            run.model.train(values.gradient_steps, values.batch_size)
        else:
            run.model.train()
        count += 1
    iteration *= values.n_steps if run.config.name == "ppo" else 1
    return (process_time() - start) / count / iteration


def torch_ratio(run: Run, seconds: float) -> float:
    """How many times as long Stable-Baselines3's updates take, with what the run has collected."""
    values = {"layer_norm": False} if run.config.name == "sac" else {}
    config = replace(run.config, algorithm=dict(run.config.algorithm) | values)
    found = []
    for kinds in ({"sac": stable_baselines3.SAC, "ppo": stable_baselines3.PPO}, {"sac": sbx.SAC, "ppo": sbx.PPO}):
        model = make_model(config, run._normal, kinds)
        for name in ("replay_buffer", "rollout_buffer"):
            if hasattr(run.model, name):
                setattr(model, name, getattr(run.model, name))
        model.set_logger(run.model.logger)
        measured = SimpleNamespace(config=config, model=model)
        update_seconds(measured, 1.0)  # compiled by then
        found.append(update_seconds(measured, seconds))
    return found[0] / found[1]


@contextmanager
def expert_seconds() -> Iterator[list[float]]:
    """Yield a list, to which the seconds of each call of an expert are added."""
    spent: list[float] = []
    real = ExpertTakeover.replace

    def timed(expert: ExpertTakeover, actions: np.ndarray) -> np.ndarray:
        start = process_time()
        found = real(expert, actions)
        spent.append(process_time() - start)
        return found

    with patch.object(ExpertTakeover, "replace", timed):
        yield spent


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", default="OpenCabinetDrawer")
    parser.add_argument("--object", default="cabinet-0003")
    parser.add_argument("--algorithms", nargs="+", default=["sac", "ppo"])
    parser.add_argument("--steps", type=int, default=20_000)
    parser.add_argument("--seconds", type=float, default=5.0, help="of what is measured alone")
    options = parser.parse_args()
    torch.set_num_threads(1)
    reinforcement.time = SimpleNamespace(perf_counter=process_time)  # what other processes do, does not count
    for name in options.algorithms:
        never = {"evaluation.every": 10**9, "checkpoint_every": 10**9, "evaluation.episodes": 1}
        given = {"objects": [options.object], "steps": options.steps, **never}
        given |= {"algorithm.learning_starts": 256} if name == "sac" else {}
        config = load_reinforcement_config(name, options.task, given)
        with tempfile.TemporaryDirectory() as folder, expert_seconds() as by_expert:
            run = reinforce(config, Path(folder))
            spent, total = run.seconds, run.seconds["total"]
            parts = {"simulation": spent["simulate"], "updates": spent["update"], "expert": sum(by_expert)}
            parts["rest"] = total - sum(parts.values())
            updates = update_seconds(run, options.seconds)
            best = 1 / (1 / simulation_rate(config, options.seconds) + updates)
            rate = run.state.step / total
            shares = ", ".join(f"{what} {part / total:.0%}" for what, part in parts.items())
            print(f"{name}: {rate:.0f} steps/s; {shares}; {rate / best:.0%} of simulating and updating alone")
            slower = torch_ratio(run, options.seconds)
            print(f"{name}: updates of Stable-Baselines3 take {slower:.1f} times as long")


if __name__ == "__main__":
    main()
