"""Where the time of reinforcement learning goes: simulation, updates, the rest, and how near that is to the best.

"Best" is what one core does that simulates and updates alone. Beside it, updates of the same sizes by
Stable-Baselines3, which has them in torch. Seconds are those of the CPU.
"""

import argparse
import tempfile
from pathlib import Path
from time import process_time
from types import SimpleNamespace

import numpy as np
import stable_baselines3
import torch

from artiskill.envs.vector_env import ManipulationVectorEnv
from artiskill.learning import reinforcement
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


def torch_update_seconds(run: Run, seconds: float) -> float:
    """Seconds of Stable-Baselines3's updates for each environment step, with what the run has collected."""
    model = make_model(run.config, run._normal, {"sac": stable_baselines3.SAC, "ppo": stable_baselines3.PPO})
    for name in ("replay_buffer", "rollout_buffer"):
        if hasattr(run.model, name):
            setattr(model, name, getattr(run.model, name))
    model.set_logger(run.model.logger)
    return update_seconds(SimpleNamespace(config=run.config, model=model), seconds)


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
        # Stable-Baselines3 does not normalise critics: neither side does
        given |= {"algorithm.learning_starts": 256, "algorithm.layer_norm": False} if name == "sac" else {}
        config = load_reinforcement_config(name, options.task, given)
        with tempfile.TemporaryDirectory() as folder:
            run = reinforce(config, Path(folder))
            spent, total = run.seconds, run.seconds["total"]
            rest = total - spent["simulate"] - spent["update"]
            updates = update_seconds(run, options.seconds)
            best = 1 / (1 / simulation_rate(config, options.seconds) + updates)
            slower = torch_update_seconds(run, options.seconds) / updates
            rate = run.state.step / total
            shares = ", ".join(
                f"{what} {part / total:.0%}"
                for what, part in (("simulation", spent["simulate"]), ("updates", spent["update"]), ("rest", rest))
            )
            print(f"{name}: {rate:.0f} steps/s; {shares}; {rate / best:.0%} of simulating and updating alone")
            print(f"{name}: updates of Stable-Baselines3 take {slower:.1f} times as long")


if __name__ == "__main__":
    main()
