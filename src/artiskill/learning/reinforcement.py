"""`reinforce`: a run of reinforcement learning from its first step to its last, or on from where it was stopped.

A library has the algorithms (`reinforcement_models.py`). What is ours: the environments, episodes in which an
expert takes over (`expert_takeover.py`), evaluation on new levels, and checkpoints from which a run goes on with
the same bits (`reinforcement_checkpoints.py`).
"""

import hashlib
import time
from collections.abc import Callable
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecNormalize

from artiskill.assets.catalog import checked_hash, object_id_of, resolve_objects
from artiskill.config import dump_yaml
from artiskill.envs.stable_baselines import as_sb3
from artiskill.envs.vector_env import ManipulationVectorEnv
from artiskill.errors import ConfigError, RunError
from artiskill.files import LOCK_FILE, lock_folder, output_path
from artiskill.learning.checkpoints import Records, TrainState, write_content
from artiskill.learning.expert_takeover import ExpertTakeover
from artiskill.learning.policy import StatePolicy
from artiskill.learning.reinforcement_checkpoints import read_checkpoint, restore, write_checkpoint
from artiskill.learning.reinforcement_config import ReinforcementConfig, read_reinforcement_config
from artiskill.learning.reinforcement_models import actor_layers, count_parameters, make_model, use_threads
from artiskill.learning.run import BEST, CONFIG, INFO, KEPT, LATEST, RunInfo, read_info, write_info, write_whole
from artiskill.learning.stopping import StopSignal
from artiskill.tasks.registry import make_task
from artiskill.versions import versions

OnStep = Callable[[int, str], None]  # steps so far, and the latest numbers as text

_CHECKPOINT_S = 300.0  # besides those every so many steps: what a crash may cost
_LIBRARIES = ("torch", "stable_baselines3", "sbx-rl", "jax", "jaxlib", "flax", "optax", "tfp-nightly")
_NOT_LOGGED = ("n_updates", "learning_rate", "ent_coef_loss")  # a count; configured; not finite of a constant
_CLIP = 10.0  # of normalised observations


def reinforce(
    config: ReinforcementConfig,
    folder: Path | str,
    threads: int = 1,
    on_lines: Callable[[list[str]], None] = lambda lines: None,
    on_start: Callable[[int], None] = lambda step: None,
    on_step: OnStep = lambda step, text: None,
) -> "Run":
    """Train, or go on with a run of the same values.

    Args:
        config: see `load_reinforcement_config`.
        folder: of the run.
        threads: of the CPU; more help hardly, as networks are small.
        on_lines: called with lines that say what will be trained.
        on_start: called with the number of steps that were taken before.
        on_step: called now and then.

    Returns:
        The run, at its end.

    Raises:
        RunError: the folder holds a run of other values or objects, or something else, or is damaged; the disk is
            full.
        ConfigError: an illegal value, or another process trains in the folder.
        UnknownNameError, AssetError: objects that do not exist, or that cannot be used.
        PolicyError: an expert shall take over, and the task has none.
        KeyboardInterrupt: a signal came; a checkpoint was saved.
    """
    folder = output_path(folder)
    if isinstance(threads, bool) or not isinstance(threads, int) or threads < 1:
        raise ConfigError(f"threads must be a whole number of at least 1, not {threads!r}")
    torch.set_num_threads(threads)
    use_threads(threads)
    with lock_folder(folder, "training run"):
        try:
            info = _info_of(config, folder)
            run = Run(config, info, folder, threads)
            _write_beginning(config, info, folder)  # only now: what is illegal leaves nothing behind
            on_lines(run.lines)
            on_start(run.state.step)
            run.train(on_step)
        except OSError as error:
            raise RunError(f"cannot write to {str(folder)!r}: {error.strerror or error}; {KEPT}") from error
    return run


def _info_of(config: ReinforcementConfig, folder: Path) -> RunInfo:
    """Return what the run's folder says of itself, or is to say; what is asked for must fit what is there."""
    make_task(config.task, config.config)  # illegal values are said first
    objects = resolve_objects(list(config.objects), task=config.task)
    hashes = " ".join(checked_hash(one) for one in objects)
    data = hashlib.sha256(hashes.encode()).hexdigest()
    if (folder / INFO).exists():
        found = read_info(folder)
        if found.algorithm != config.name:
            raise RunError(f"{str(folder)!r} holds a run of {found.algorithm}, not of {config.name}")
        read_reinforcement_config(folder).check_continues(config, folder)
        if found.data != data:
            raise RunError(f"{str(folder)!r} holds a run on other objects; choose another folder")
        return found
    others = sorted({path.name for path in folder.iterdir()} - {LOCK_FILE, CONFIG})
    if others:
        raise RunError(f"{str(folder)!r} holds no training run, but {others[0]!r}; choose another folder")
    return RunInfo(
        task=config.task,
        algorithm=config.name,
        control_mode="joint",
        sampling={},
        sizes={},
        statistics={},
        overrides=dict(config.config),
        data=data,
        objects=[object_id_of(one) for one in objects],
        steps=config.steps,
        versions=versions() | {name: version(name) for name in _LIBRARIES},
    )


def _write_beginning(config: ReinforcementConfig, info: RunInfo, folder: Path) -> None:
    write_whole(folder / CONFIG, dump_yaml(config).encode())
    if not (folder / INFO).exists():  # last: from now on the folder holds a run
        write_info(info, folder)


class _Solved(Exception):  # noqa: N818 - no error
    """Leaves the library's loop: measurements say that it is solved."""


class _Scaled(gym.vector.VectorWrapper[Any, Any, Any, Any, Any]):
    """Scales rewards, and measures how long the environments take."""

    def __init__(self, env: ManipulationVectorEnv, scale: float) -> None:
        super().__init__(env)
        self._scale, self.seconds = scale, 0.0

    def step(self, actions: Any) -> Any:
        start = time.perf_counter()
        observations, rewards, terminated, truncated, infos = self.env.step(actions)
        self.seconds += time.perf_counter() - start
        return observations, rewards * self._scale, terminated, truncated, infos


class Run:
    """A run that trains, from its latest checkpoint if it has one.

    Args:
        config: resolved.
        info: of the run.
        folder: of the run; locked by the caller.
        threads: of the CPU.

    Attributes:
        state: where the run stands.
        model: SBX's.
        seconds: name -> spent by this process in `simulate`, `update` and `total`, without evaluation and saving.

    Raises:
        RunError: the checkpoint is damaged.
        PolicyError: an expert shall take over, and the task has none.
    """

    def __init__(self, config: ReinforcementConfig, info: RunInfo, folder: Path, threads: int) -> None:
        self.config, self.info, self._folder, self._threads = config, info, folder, threads
        self.state, self._stop = TrainState(), StopSignal()
        self.seconds = dict.fromkeys(("simulate", "update", "total"), 0.0)
        saved: dict[str, Any] | None = None
        if (folder / LATEST).is_file():
            self.state, saved = read_checkpoint(folder)
        env = self._make_env(config.envs, False) if saved is None else saved["env"]
        self._scaled = _Scaled(env, config.reward_scale)
        self._normal = VecNormalize(
            as_sb3(self._scaled), norm_obs=config.normalise, norm_reward=False, clip_obs=_CLIP
        )
        self.model = make_model(config, self._normal)
        if config.expert_share > 0:
            steps = config.values.takeover_steps
            self.model.expert = ExpertTakeover(env, config.expert_share, steps, config.seed)
        if saved is not None:
            try:
                restore(self.model, saved)
            except (RuntimeError, LookupError, TypeError, ValueError) as error:
                raise RunError(f"{str(folder / LATEST)!r} does not fit the run: {error}") from error
        self._saved_at, self._saved_step = time.perf_counter(), self.state.step

    @property
    def lines(self) -> list[str]:
        """What will be trained."""
        config, measured, objects = self.config, self.config.evaluation, self.info.objects
        ends = measured.stop_after
        named = f"{len(objects)} objects" if len(objects) > 1 else objects[0]
        target = f", {config.target}" if config.target else ""
        takes_over = f"; the expert takes over in {config.expert_share:.0%} of the episodes"
        return [
            f"{config.name}, {config.task}: {named}{target}, from the state"
            + (takes_over if config.expert_share else ""),
            f"{config.envs} environments, {config.steps} steps; {count_parameters(self.model)} parameters",
            f"success in {self.episodes} episodes on new levels every {measured.every} steps chooses the "
            "checkpoint"
            + (f"; {ends} times {measured.success_threshold:.0%} in a row end the run" if ends else ""),
        ]

    def _make_env(self, count: int, is_evaluation: bool) -> ManipulationVectorEnv:
        ends = is_evaluation or self.config.terminate_on_success
        return ManipulationVectorEnv(
            count,
            self.config.task,
            list(self.config.objects),
            target=self.config.target,
            config=self.config.config,
            num_threads=min(self._threads, count),
            autoreset_mode="same_step",
            terminate_on_success=ends,
        )

    # -- the loop ------------------------------------------------------------------------------------------------

    def train(self, on_step: OnStep = lambda step, text: None) -> None:
        """Train until the configuration's number of steps, or until measurements say that it is solved.

        Raises:
            OSError: a file cannot be written.
            KeyboardInterrupt: a signal came; a checkpoint was saved.
        """
        with self._stop, Records(self._folder, self.state, True) as records:
            loop = _Loop(self, records, on_step)
            if self.is_measurement_due:  # a signal has ended it
                self.develop(records)
            if self.state.step < self.config.steps and not self.is_solved:
                loop.begin()
                with suppress(_Solved):
                    self.model.learn(
                        self.config.steps - self.state.step, loop, log_interval=None, reset_num_timesteps=False
                    )
                    loop.end_iteration()
                if self.state.sums:
                    loop.log()
            if self.state.developed < self.state.step:
                self.develop(records)
            if self._saved_step != self.state.step:
                self.save()

    def develop(self, records: Records) -> None:
        """Measure success on new levels; the best weights so far are kept.

        Raises:
            OSError: a file cannot be written.
            KeyboardInterrupt: a signal came; a checkpoint was saved.
        """
        found = self.evaluate()
        successes = sum(row[2] for row in found)
        self.state.developed = self.state.step
        self.state.measured = [*self.state.measured, successes]
        if successes >= self.state.best_successes:  # of equal ones the latest
            self.state.best_step, self.state.best_successes = self.state.step, successes
            write_content(self._folder / BEST, {"state": dict(vars(self.state)), "acting": self.acting})
        records.add_development(self.state, found)

    @property
    def episodes(self) -> int:
        """How many a measurement has: at least one on each object."""
        return max(self.config.evaluation.episodes, len(self.info.objects))

    @property
    def is_measurement_due(self) -> bool:
        """Whether a multiple of `evaluation.every` steps was reached since the last measurement."""
        return self.is_due(self.state.developed, self.config.evaluation.every)

    @property
    def is_solved(self) -> bool:
        """Whether the latest measurements end the run."""
        wanted, measured = self.config.evaluation, self.state.measured
        reach = [one / self.episodes >= wanted.success_threshold for one in measured[-wanted.stop_after :]]
        return 0 < wanted.stop_after <= len(reach) and all(reach)

    def evaluate(self) -> list[tuple[str, int, int]]:
        """Return a row of object, episodes and successes each, of deterministic actions on new levels."""
        first, policy = self.config.evaluation.first_level, StatePolicy.of(self.acting)
        env = self._make_env(self.episodes, True)
        objects = [self.info.objects[i % len(self.info.objects)] for i in range(self.episodes)]
        levels = list(range(first, first + self.episodes))
        given = resolve_objects(list(self.config.objects), task=self.config.task)
        found = dict(zip(self.info.objects, given, strict=True))
        observations, _ = env.reset(options={"level": levels, "object": [found[name] for name in objects]})
        over, solved = np.zeros(len(levels), dtype=bool), np.zeros(len(levels), dtype=bool)
        while not over.all():
            observations, _, terminated, truncated, _ = env.step(policy.act_all(observations))
            solved |= terminated & ~over
            over |= terminated | truncated
            self.check_stop()
        env.close()
        return [
            (name, objects.count(name), int(sum(solved[i] for i, one in enumerate(objects) if one == name)))
            for name in dict.fromkeys(objects)
        ]

    # -- checkpoints ---------------------------------------------------------------------------------------------

    @property
    def acting(self) -> dict[str, Any]:
        """What `StatePolicy` needs."""
        weights, biases = actor_layers(self.model)
        activation, squash = ("relu", "tanh") if self.config.name == "sac" else ("tanh", "clip")
        rms: Any = self._normal.obs_rms if self.config.normalise else None
        size = weights[0].shape[1]
        return {
            "weights": weights,
            "biases": biases,
            "activation": activation,
            "squash": squash,
            "mean": torch.zeros(size) if rms is None else torch.from_numpy(rms.mean.copy()),
            "std": torch.ones(size) if rms is None else torch.from_numpy(np.sqrt(rms.var + self._normal.epsilon)),
            "clip": _CLIP if self.config.normalise else float("inf"),
            "observation_config": self.info.observation_config,
        }

    def save(self) -> None:
        """Write a checkpoint.

        Raises:
            OSError: it cannot be written; the one before is as it was.
            RunError: a weight is not finite.
        """
        write_checkpoint(self._folder, self.state, self.acting, self.model, self._scaled.unwrapped)
        self._saved_at, self._saved_step = time.perf_counter(), self.state.step

    def check_stop(self) -> None:
        """Save a checkpoint and raise `KeyboardInterrupt`, if a signal came."""
        if self._stop.is_set:
            if self._saved_step != self.state.step:
                self.save()
            raise KeyboardInterrupt(f"interrupted after step {self.state.step}, which is saved")

    def is_due(self, before: int, every: int) -> bool:
        """Whether a multiple of `every` steps was reached since the step `before`."""
        return self.state.step // every > before // every


class _Loop(BaseCallback):
    """What is done between two updates: the library calls it at the beginning of each collection."""

    def __init__(self, run: Run, records: Records, on_step: OnStep) -> None:
        super().__init__()
        self._run, self._records, self._report = run, records, on_step
        self._text = ""
        self._is_first = True

    def begin(self) -> None:
        """Start the clock."""
        self._at, self._simulated = time.perf_counter(), self._run._scaled.seconds

    def _on_step(self) -> bool:
        rewards, dones = self.locals["rewards"], self.locals["dones"]
        expert = getattr(self.model, "expert", None)
        self._add("reward", float(rewards.sum()) / self._run.config.reward_scale, len(rewards))
        for env in np.flatnonzero(dones).tolist():
            solved = float(self.locals["infos"][env]["success"])
            if expert is None or not expert.is_drawn[env]:
                self._add("success", solved, 1)
            elif expert.has_taken_over[env]:  # what ends before counts for nobody: it would favour agents
                self._add("expert_success", solved, 1)
        return True

    def _on_rollout_end(self) -> None:
        self._collected_at = time.perf_counter()

    def _on_rollout_start(self) -> None:
        if not self._is_first:
            self.end_iteration()
        self._is_first = False

    def _add(self, name: str, value: float, count: int) -> None:
        total, counted = self._run.state.sums.get(name, (0.0, 0))
        self._run.state.sums[name] = total + value, counted + count

    def end_iteration(self) -> None:
        """Log, measure and save as far as it is time; the library has collected and updated."""
        run, state, config, now = self._run, self._run.state, self._run.config, time.perf_counter()
        before, state.step = state.step, int(run.model.num_timesteps)
        spent = {
            "simulate": run._scaled.seconds - self._simulated,
            "update": now - self._collected_at,
            "total": now - self._at,
        }
        for name, seconds in spent.items():
            run.seconds[name] += seconds
        state.seconds += spent["total"]
        for name, value in run.model.logger.name_to_value.items():
            what = name.removeprefix("train/")
            if what != name and not what.startswith(_NOT_LOGGED) and isinstance(value, float | np.number):
                self._add(what, float(value), 1)
        run.model.logger.name_to_value.clear()
        if run.is_due(before, config.log_every):
            self.log()
        if run.is_measurement_due:
            run.develop(self._records)
        if run.is_due(before, config.checkpoint_every) or now - run._saved_at > _CHECKPOINT_S:
            run.save()
        self._report(min(state.step, config.steps), self._text)
        run.check_stop()
        if run.is_solved:
            raise _Solved
        self.begin()

    def log(self) -> None:
        """Write a row of means since the one before."""
        state = self._run.state
        means = {name: total / count for name, (total, count) in sorted(state.sums.items())}
        state.sums = {}
        self._records.add_means(state, means, self._run.config.values.learning_rate)
        solved = f", {means['success']:.0%} solved in training" if "success" in means else ""
        best = state.best_successes
        measured = f", best {best} of {self._run.episodes}" if best >= 0 else ""
        self._text = f"reward {means.get('reward', float('nan')):.2f} a step{solved}{measured}"
