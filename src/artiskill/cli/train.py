"""`artiskill train`: a policy from demonstrations, or from an expert that is asked, by one of the algorithms."""

import argparse
import os
import shlex
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from artiskill.cli.parser import UsageError, add_command, add_set, add_workers, overrides_of, workers_of
from artiskill.cli.progress import PhaseBars, ProgressBar
from artiskill.errors import MissingExtraError

if TYPE_CHECKING:  # imports that `artiskill --help` must not wait for
    from artiskill.learning.reinforcement_config import ReinforcementConfig
    from artiskill.learning.run import RunInfo
    from artiskill.learning.train import RolloutData, TrainData
    from artiskill.learning.train_config import TrainConfig
    from artiskill.learning.trainer import Develop, Trainer

_FIRST_NEW_LEVEL = 1_000_000  # runs of `sac` and `ppo` with small seeds have played the first levels

_EPILOG = """examples:
  artiskill train bc --task OpenCabinetDrawer --data training/drawers --out runs/drawer-bc
  artiskill train bc --task PushChair --data demos/chairs --out runs/chair-bc --points 512 --frame robot
  artiskill train td3bc --task OpenCabinetDrawer --data training/drawers --out runs/drawer-td3bc \\
      --network pointnet_transformer --steps 150000 --precision bfloat16 --set algorithm.alpha=0.2
  artiskill train dagger --task OpenCabinetDrawer --out runs/drawer-dagger
  artiskill train sac --task OpenCabinetDrawer --objects cabinet-0002 --target link_0 --out runs/one-drawer
  artiskill train sac --task PushChair --objects chair-0018 --out runs/one-chair
  torchrun --nproc-per-node 2 -m artiskill train bc ...     # with several GPUs

The same command goes on where a run was stopped; with schedule=constant and more --steps beyond its end.
docs/training_runs.md describes data, runs and values."""
_ALGORITHMS = "bc, bcq, td3bc or command_bc, from demonstrations; dagger, from an expert; sac or ppo, from rewards"

# options that reinforcement learning does not have
_NOT_REINFORCEMENT = ("data", "points", "frame", "network", "samples", "precision", "dev_objects", "workers")
_PASSES = 7  # of gradient steps over the steps of rollouts


def add_commands(commands: Any) -> None:
    """Add the command."""
    parser = add_command(commands, "train", _run_train, "train a policy", _EPILOG)
    add = parser.add_argument
    add("algorithm", metavar="ALGORITHM", help=_ALGORITHMS)
    add("--task", required=True, help="name of the task, or module:Task of your own package")
    data = "training set, training files with point clouds, or demonstrations; not for dagger"
    add("--data", type=Path, metavar="FOLDER", help=data)
    add("--out", type=Path, required=True, metavar="FOLDER", help="folder of the run")
    add("--points", type=int, help="points of a cloud (default: a training set's, else at most 256; dagger: 128)")
    add("--frame", help="frame of the points: world, robot or end_effector (default: the data's, else world)")
    add(
        "--network",
        help="small (default), small_transformer, pointnet, pointnet_transformer, or kinematic (default of dagger "
        "and command_bc)",
    )
    steps = (
        "gradient steps (default: bc: 6000; bcq, td3bc: 20000; command_bc: 12000, doors 24000; dagger: 5200 for "
        "drawers, else 10500)"
    )
    most = "sac: at most 400000, doors 600000, chairs and buckets 1000000; ppo: 2000000"
    add("--steps", type=int, help=f"{steps}, or of environments ({most})")
    rollouts = "dagger, sac, ppo: learn on these (default: train; dagger: and hundreds of generated ones)"
    add("--objects", nargs="+", metavar="OBJECT", help=rollouts)
    add("--target", metavar="LINK", help="sac, ppo: open only this one (default: each episode draws one)")
    add("--envs", type=int, help="sac, ppo: environments side by side (default: 16)")
    samples = "dagger: steps of rollouts, whole rounds; 7 passes over them (default: drawers 96000, else 192000)"
    add("--samples", type=int, help=samples)
    batches = "samples of a step (default: bc, dagger: 128; bcq, td3bc, command_bc: 64; sac: 128; ppo: 256)"
    add("--batch-size", type=int, help=batches)
    add("--seed", type=int, help="of weights, batches and noise (default: 0)")
    add("--device", default="auto", help="auto, cpu or cuda (default: %(default)s; sac, ppo: cpu)")
    add("--precision", help="float32 or bfloat16 (default: float32)")
    add("--threads", type=int, help="threads of the CPU, in each process (default: one per core; sac, ppo: 1)")
    objects = "measure success on these during training: generated:CATEGORY:SEEDS, ids, splits; none for never"
    add("--dev-objects", nargs="+", metavar="OBJECT", help=objects)
    add("--dev-episodes", type=int, help="episodes on each of them (default: 2; dagger: 4; sac, ppo: 20 in all)")
    every = "bcq, td3bc, command_bc: 2000; bc: 1000; dagger: 1300; sac: 20000; ppo: 50000"
    add("--dev-every", type=int, metavar="STEPS", help=f"from one measurement to the next (default: {every})")
    add_set(parser, "change values, see config.yaml of a run")
    add_workers(parser, "; sac, ppo: always one")


def _run_train(arguments: argparse.Namespace) -> None:
    from artiskill.learning.run import FROM_STATE, check_torch

    check_torch("training")
    if arguments.algorithm in FROM_STATE:
        _run_reinforcement(arguments)
        return
    from artiskill.learning.train import train
    from artiskill.learning.train_config import load_train_config

    config = load_train_config(arguments.algorithm, arguments.task, arguments.network, _overrides(arguments))
    screen = _Screen(config)
    data = _data(arguments, screen)
    develop = _development(config, data.workers) if screen.is_first else None
    try:
        with screen.bars:
            trainer = train(
                config,
                data,
                arguments.out,
                arguments.device,
                arguments.threads,
                develop,
                screen.show_lines,
                screen.bars.show,
                screen.begin,
                screen.show_step,
            )
    except KeyboardInterrupt as interrupt:
        command = shlex.join(["artiskill", *sys.argv[1:]])
        raise KeyboardInterrupt(f"{str(interrupt) or 'interrupted'}; go on with: {command}") from interrupt
    if screen.is_first:
        _print_end(trainer, arguments.out)


def _run_reinforcement(arguments: argparse.Namespace) -> None:
    """Train by reinforcement learning, in the task's environments."""
    from artiskill.learning.processes import check_alone
    from artiskill.learning.reinforcement_config import load_reinforcement_config

    for name in _NOT_REINFORCEMENT:
        if getattr(arguments, name) is not None:
            raise UsageError(f"--{name.replace('_', '-')} is not for {arguments.algorithm}")
    if arguments.device not in ("auto", "cpu"):
        raise UsageError(f"--device is auto or cpu for {arguments.algorithm}, not {arguments.device!r}")
    check_alone(arguments.algorithm)
    given = {
        "objects": arguments.objects,
        "target": arguments.target,
        "steps": arguments.steps,
        "envs": arguments.envs,
        "seed": arguments.seed,
        "evaluation.episodes": arguments.dev_episodes,
        "evaluation.every": arguments.dev_every,
        "algorithm.batch_size": arguments.batch_size,
    }
    own = {key: value for key, value in given.items() if value is not None}
    config = load_reinforcement_config(arguments.algorithm, arguments.task, own | overrides_of(arguments.set))
    try:
        from artiskill.learning.reinforcement import reinforce
    except ImportError as error:
        if (error.name or "").partition(".")[0] not in ("stable_baselines3", "sbx", "jax"):
            raise
        raise MissingExtraError(f"training by {arguments.algorithm}", "rl") from error
    screen = _Screen(config)
    try:
        with screen.bars:
            run = reinforce(
                config,
                arguments.out,
                1 if arguments.threads is None else arguments.threads,
                screen.show_lines,
                screen.begin,
                screen.show_step,
            )
    except KeyboardInterrupt as interrupt:
        command = shlex.join(["artiskill", *sys.argv[1:]])
        raise KeyboardInterrupt(f"{str(interrupt) or 'interrupted'}; go on with: {command}") from interrupt
    state = run.state
    print(f"trained: {arguments.out}, {state.step} steps in {state.seconds:.0f} s")
    if run.is_solved:
        wanted = f"{config.evaluation.stop_after} times {config.evaluation.success_threshold:.0%} in a row"
        print(f"ended: success reached {wanted}; evaluation.stop_after=0 goes on to the end of the steps")
    print(f"best: step {state.best_step}, {state.best_successes} of {run.episodes} episodes on new levels solved")
    named = " ".join(config.objects) + (f" --target {config.target}" if config.target else "")
    named += f" --first-level {_FIRST_NEW_LEVEL}"
    print(f"measure it: artiskill evaluate --policy {arguments.out} --objects {named}")


def _data(arguments: argparse.Namespace, screen: "_Screen") -> "TrainData | RolloutData":
    """Return what the run learns from: demonstrations, or rollouts.

    Raises:
        UsageError: an option that the algorithm does not have, or none of one that it needs.
    """
    from artiskill.learning.train import RolloutData, TrainData
    from artiskill.learning.train_config import INTERACTIVE

    for name in ("target", "envs"):
        if getattr(arguments, name) is not None:
            raise UsageError(f"--{name} is for sac and ppo, not for {arguments.algorithm}")
    if arguments.algorithm not in INTERACTIVE:
        if arguments.data is None:
            raise UsageError(f"{arguments.algorithm} learns from demonstrations: --data is needed")
        for name in ("objects", "samples"):
            if getattr(arguments, name) is not None:
                raise UsageError(f"--{name} is for {', '.join(INTERACTIVE)}, not for {arguments.algorithm}")
        return TrainData(arguments.data, arguments.points, arguments.frame, workers_of(arguments))
    for name in ("data", "frame"):
        if getattr(arguments, name) is not None:
            raise UsageError(f"--{name} is of demonstrations; {arguments.algorithm} learns from an expert")
    return RolloutData(workers_of(arguments), screen.show_note)


def _rollout_overrides(arguments: argparse.Namespace, others: dict[str, Any]) -> dict[str, Any]:
    """Return the values that options of an interactive algorithm set, beside others."""
    from artiskill.learning.train_config import INTERACTIVE, load_train_config

    if arguments.algorithm not in INTERACTIVE:
        return {}
    given = {"algorithm.points": arguments.points, "algorithm.objects": arguments.objects}
    if arguments.samples is not None:
        if arguments.samples < 1:
            raise UsageError(f"--samples must be at least 1, not {arguments.samples}")
        from artiskill.learning.dagger import fitting_steps  # it needs torch

        plain = load_train_config(arguments.algorithm, arguments.task, arguments.network, others)
        values = plain.algorithm
        size = values["collectors"] * values["envs"] * values["rollout_steps"]
        rounds = -(-arguments.samples // size)
        steps = max(1, _PASSES * rounds * size // plain.batch_size)
        given |= {"algorithm.rounds": rounds, "steps": fitting_steps(steps, rounds)}
    return {key: value for key, value in given.items() if value is not None}


def _overrides(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the values that options set; those of `--set` come last."""
    given = {
        "steps": arguments.steps,
        "batch_size": arguments.batch_size,
        "seed": arguments.seed,
        "precision": arguments.precision,
        "development.episodes": arguments.dev_episodes,
        "development.every": arguments.dev_every,
        "development.objects": _development_objects(arguments.dev_objects),
    }
    own = {key: value for key, value in given.items() if value is not None} | overrides_of(arguments.set)
    return _rollout_overrides(arguments, own) | own


def _development_objects(given: list[str] | None) -> list[str] | None:
    if given is None or "none" not in given:
        return given
    if given != ["none"]:
        raise UsageError("--dev-objects none takes no other object")
    return []


def _development(config: "TrainConfig", workers: int) -> "Callable[[RunInfo], Develop] | None":
    """Return what makes the measurement of success of a run's info, where there are objects, and the engine."""
    if not config.development.objects:
        return None
    from artiskill.learning.train_config import check_development

    try:
        from artiskill.evaluation.evaluate import make_develop
    except ImportError as error:
        print(f"note: {error.name} is not installed, so success cannot be measured here", file=sys.stderr)
        return None
    return partial(make_develop, config, check_development(config), workers)


class _Screen:
    """What a person sees of a run: first lines, progress of a training set, progress of training."""

    def __init__(self, config: "TrainConfig | ReinforcementConfig") -> None:
        self._config = config
        self.bars = PhaseBars()
        self._bar: ProgressBar | None = None  # of training
        self.is_first = os.environ.get("RANK", "0") == "0"

    def show_lines(self, lines: list[str]) -> None:
        """Print what will be trained."""
        self.bars.close()
        for line in lines:
            print(line, flush=True)

    def show_note(self, text: str) -> None:
        """Print a line about a round of rollouts."""
        if self._bar is not None:
            self._bar.print(text)

    def begin(self, step: int) -> None:
        """Show progress from this step on."""
        if not self.is_first:
            return
        if step:
            print(f"going on after step {step}", flush=True)
        self._bar = self.bars.open("training", self._config.steps, "steps")
        self._bar.skip(step)

    def show_step(self, step: int, text: str) -> None:
        """Show how many steps were taken."""
        if self._bar is not None:
            self._bar.show(step, text)


def _print_end(trainer: "Trainer", folder: Path) -> None:
    state, wanted = trainer.state, trainer.config.development
    print(f"trained: {folder}, {state.step} steps in {state.seconds:.0f} s")
    if state.best_successes >= 0:
        print(
            f"best: step {state.best_step}, {state.best_successes} episodes of development objects solved, "
            f"{wanted.episodes} on each"
        )
    print(f"measure it: artiskill evaluate --policy {folder}")
