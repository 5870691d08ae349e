"""Rounds of rollouts for DAgger: who acts, what is seen, and what the expert would command there.

Seed, round and collector fix a rollout, given the weights of the policy; so it is the same in any number of
processes. The rounds' files, in the run's folder, and its checkpoints are all that going on needs.
"""

import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import lru_cache, partial
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch

from artiskill.assets.catalog import object_id_of, resolve_objects
from artiskill.config import check, from_mapping, to_mapping
from artiskill.demos.demonstrator import FAULTS
from artiskill.envs.control import JOINT
from artiskill.envs.vector_env import ManipulationVectorEnv
from artiskill.envs.wrappers import Sampling, VectorPointCloudDownsample
from artiskill.errors import DivergedError, RunError
from artiskill.experts.variation import Disturbance, load_variation
from artiskill.files import DAMAGED_ARCHIVE, atomic_write
from artiskill.jobs.fork_server import fork_server
from artiskill.jobs.parallel import run_jobs
from artiskill.jobs.worker import Send
from artiskill.learning.array_policy import make_actor
from artiskill.learning.augmentation import Augmentation
from artiskill.learning.batch import Batch, Observation, Sizes, Statistics
from artiskill.learning.checkpoints import load_weights, make_algorithm, save_weights
from artiskill.learning.commands import CommandSpace, command_space, commanding_expert
from artiskill.learning.dagger import DAggerConfig
from artiskill.learning.expert_takeover import check_takeover
from artiskill.learning.policy import one_thread
from artiskill.learning.run import CONFIG, INFO, RunInfo, Table, read_info
from artiskill.learning.train_config import (
    TrainConfig,
    algorithm_config,
    check_not_measured,
    hash_of,
    kinds_of,
    objects_by_id,
    read_train_config,
)
from artiskill.learning.trainer import Trainer
from artiskill.tasks.point_shares import shared_out
from artiskill.tasks.registry import make_task
from artiskill.tasks.state_vector import robot_fields
from artiskill.tasks.task import Task

ROUNDS, TABLE = "rounds", "rounds.csv"
FRAME = "robot"  # of the points
# levels of rollouts: far from those of demonstrations, of evaluations and of development
_LEVELS = (1_000_000_000, 1_900_000_000)
_MESSAGE_STEPS = 10
_PRIVATE_STREAM = 7  # tells the random numbers of rollouts from others of the same seed


class Counts(NamedTuple):
    """What came of a rollout."""

    samples: int = 0
    expert_episodes: int = 0  # that have ended, with the expert acting to the end, and perhaps from the beginning
    expert_successes: int = 0
    policy_episodes: int = 0  # in which the policy acted to the end
    policy_successes: int = 0
    seconds: float = 0.0
    labelling_s: float = 0.0  # of these, in which the expert was asked


class Rollouts:
    """What a run of DAgger learns from.

    Args:
        config: of the run.
        folder: of the run.
        workers: processes that collect.
        on_note: called with a line about each round.

    Raises:
        PolicyError: the task has no expert, or one that gives no commands.
        ConfigError: objects of a split that is measured, shares for another number of masks, or late takeovers.
        UnknownNameError, AssetError: objects that do not exist, or that the task cannot use.
    """

    def __init__(
        self, config: TrainConfig, folder: Path, workers: int = 1, on_note: Callable[[str], None] = print
    ) -> None:
        self.config, self.folder, self.workers, self.on_note = config, folder, workers, on_note
        self.values: DAggerConfig = algorithm_config(config)
        self.round_steps = self.values.round_steps(config.steps)
        is_alone = self.values.expert_rounds >= self.values.rounds
        self.notes = ["note: the expert acts in all rounds, so this is behaviour cloning"] * is_alone
        self.task = make_task(config.task)
        wanted, names = len(self.task.mask_names) + 1, ", ".join(self.task.mask_names)
        check(
            len(self.values.shares) == wanted,
            f"algorithm.shares needs {wanted} numbers for {config.task}, one for each of the masks {names}, and "
            f"one for the others, not {list(self.values.shares)}",
        )
        found = resolve_objects(list(self.values.objects), task=config.task)
        check_not_measured(found)
        check_takeover(self.values.takeover_steps, self.task)
        self.objects = [object_id_of(item) for item in found]
        self._hash = hash_of(found)
        has_share = self.values.generated_share is not None
        text = "algorithm.generated_share is for generated objects beside others; leave it out: null"
        check(not has_share or all(kinds_of(self.objects)), text)

    @property
    def text(self) -> str:
        """What is learned from, in a line."""
        values = self.values
        samples = values.rounds * values.round_samples
        return (
            f"up to {samples} steps of {values.rounds} rounds on {len(self.objects)} objects, "
            f"{values.points} points each"
        )

    def info(self, config: TrainConfig, versions: dict[str, str]) -> RunInfo:
        """Return what a new run says of itself."""
        task, values = self.task, self.values
        expert = commanding_expert(task, values.expert)
        agent = sum(field.size for field in robot_fields(len(task.robot.mounts)))
        space = command_space(task, expert.controller, expert.phases, values.one_kind)
        actions = len(expert.controller.whole_body.scale.center)
        sizes = Sizes(values.points, len(task.mask_names), agent, actions)
        # an illegal one is refused before anything is written
        Augmentation(values.augmentation, space, FRAME, sizes.masks)
        zeros, ones = np.zeros(3), np.ones(3)
        plain = Statistics(zeros, ones, np.zeros(agent), np.ones(agent), np.ones(()))._asdict()
        return RunInfo(
            task=self.config.task,
            algorithm=self.config.name,
            control_mode=JOINT,
            sampling={
                "num_points": values.points,
                "method": "shares",
                "frame": FRAME,
                "settings": {"shares": shared_out(values.points, values.shares)},
            },
            sizes=dict(vars(sizes)),
            statistics={name: np.atleast_1d(one).tolist() for name, one in plain.items()},
            overrides={},
            data=self._hash,
            objects=self.objects,
            steps=values.rounds * values.round_samples,
            versions=versions,
            commands=to_mapping(space),
        )

    def batches(self, trainer: Trainer) -> AbstractContextManager["RoundBatches"]:
        """Return the batches of a run from where it stands."""
        return nullcontext(RoundBatches(self, trainer))


class RoundBatches:
    """An endless iterator of batches; where a round begins it is collected, if that has not been done before.

    Args:
        rollouts: of the run.
        trainer: of the run.
    """

    def __init__(self, rollouts: Rollouts, trainer: Trainer) -> None:
        self._rollouts, self._trainer, self._round_steps = rollouts, trainer, rollouts.round_steps
        self._step, values = trainer.state.step, rollouts.values
        self._layout = trainer.info.layout
        self._table = Table(rollouts.folder / TABLE, self._step)
        space = from_mapping(CommandSpace, trainer.info.commands, "commands")
        self._augmentation = Augmentation(values.augmentation, space, FRAME, trainer.info.sizes["masks"])
        self._rounds = 0  # that were taken in
        self._samples = 0  # of these
        self._records = np.empty(trainer.info.steps, self._layout.dtype)  # of all rounds, at most
        self._labels = np.empty((trainer.info.steps, space.label_size), np.float32)

    def __iter__(self) -> "RoundBatches":
        """Return itself."""
        return self

    def __next__(self) -> Batch:
        """Return the next batch: drawn from all steps so far, each as likely as any other."""
        while self._rounds <= self._step // self._round_steps:
            self._add_round(self._rounds)
            self._rounds += 1
        config, device = self._rollouts.config, self._trainer.processes.device
        rng = np.random.Generator(np.random.Philox(key=config.seed, counter=[0, 0, 0, self._step]))
        rows = np.sort(rng.integers(0, self._samples, config.batch_size))
        self._step += 1
        arrays, labels = self._augmentation(self._layout.decode(self._records[rows]), self._labels[rows], rng)
        seen = Observation(*(torch.from_numpy(one).to(device) for one in arrays))
        label = torch.from_numpy(labels).to(device)
        zeros = torch.zeros(len(label), device=device)
        return Batch(seen, label, weight=zeros + 1.0, reward=zeros, terminated=zeros, next_observation=None)

    def _add_round(self, number: int) -> None:
        """Take in a round; collect what of it is not there."""
        rollouts, values = self._rollouts, self._rollouts.values
        jobs = [RolloutJob(rollouts.folder, number, k) for k in range(values.collectors)]
        missing = [job for job in jobs if not job.path.exists()]
        if self._step == number * self._round_steps:
            self._trainer.save()
        if missing:
            if number >= values.expert_rounds and not jobs[0].policy.exists():
                if self._step != number * self._round_steps:
                    raise RunError(f"{str(jobs[0].policy)!r} is missing: train anew, in another folder")
                save_weights(jobs[0].policy, self._trainer.state, self._trainer.acting)
            self._collect(missing)
        counts = [self._read(job) for job in jobs]
        total = Counts(*(sum(values) for values in zip(*counts, strict=True)))
        rows = {int(row["round"]) for row in self._table.rows}
        if number not in rows:
            values_of = {name: round(value, 1) for name, value in total._asdict().items()}
            self._table.add({"step": number * self._round_steps, "round": number, **values_of})
            rollouts.on_note(f"round {number}: {_text(total)}")

    def _collect(self, jobs: list["RolloutJob"]) -> None:
        workers = min(self._rollouts.workers, len(jobs))
        if workers > 1:
            fork_server().prepare(partial(import_module, __name__))
        run_jobs(collect, jobs, workers, lambda message: self._trainer.check_stop(), str)

    def _read(self, job: "RolloutJob") -> Counts:
        try:
            with job.path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
                records, labels, counts = (archive[name] for name in ("records", "labels", "counts"))
            rows = slice(self._samples, self._samples + len(labels))
            self._records[rows] = records.view(self._layout.dtype).reshape(-1)
            self._labels[rows] = labels
            self._samples += len(labels)
            return Counts(*counts.tolist())
        except DAMAGED_ARCHIVE as error:
            text = f"{str(job.path)!r} is damaged ({error}): remove it, and the same command collects it again"
            raise RunError(text) from error


def _text(counts: Counts) -> str:
    policy = f"policy {counts.policy_successes:.0f} of {counts.policy_episodes:.0f} solved, "
    return (
        f"{counts.samples:.0f} steps, {policy if counts.policy_episodes else ''}"
        f"expert {counts.expert_successes:.0f} of {counts.expert_episodes:.0f}, {counts.seconds:.0f} s "
        f"({counts.labelling_s / max(counts.seconds, 1e-9):.0%} of it the expert)"
    )


# -- collecting ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class RolloutJob:
    """A rollout of one vector of environments.

    Attributes:
        folder: of the run.
        round: number of the round.
        collector: number of the vector in the round.
    """

    folder: Path
    round: int
    collector: int

    @property
    def path(self) -> Path:
        """Where it is stored."""
        return self.folder / ROUNDS / f"{self.round:04d}-{self.collector}.npz"

    @property
    def policy(self) -> Path:
        """Weights of the policy that acts in this round."""
        return self.folder / ROUNDS / f"{self.round:04d}.pt"


def collect(job: RolloutJob, send: Send) -> None:
    """Roll out, and store what was seen and commanded; messages come on the way."""
    with one_thread():
        run = (job.folder / CONFIG).read_bytes(), (job.folder / INFO).read_bytes()
        records, labels, counts = _collector(job.folder, run).run(job, send)
    job.path.parent.mkdir(parents=True, exist_ok=True)
    as_bytes = records.view(np.uint8).reshape(len(records), -1)
    with atomic_write(job.path) as temporary, temporary.open("wb") as file:
        np.savez(file, records=as_bytes, labels=labels, counts=np.array(counts))


@lru_cache(maxsize=1)
def _collector(folder: Path, run: tuple[bytes, bytes]) -> "Collector":
    """Return what collects for a run; `run`, what its files hold, tells it from one that was there before."""
    return Collector(read_train_config(folder), read_info(folder))


class _Episode(NamedTuple):
    """Who acts in an episode of an environment."""

    policy_steps: int  # that many steps the policy acts, then the expert
    is_whole: bool  # whether the policy acts to the end
    disturbance: Disturbance  # while the expert acts


class _Met(NamedTuple):
    """What B environments were in, in one step."""

    records: np.ndarray  # (B,)
    labels: np.ndarray  # (B, V)
    is_good: np.ndarray  # (B,) bool, whether the expert knows what to do


class Collector:
    """A vector of environments, an expert, and a policy.

    Args:
        config: of the run.
        info: likewise.
    """

    def __init__(self, config: TrainConfig, info: RunInfo) -> None:
        self._config, self._info = config, info
        self._values: DAggerConfig = algorithm_config(config)
        self._actor, self._layout = make_actor(info.commands), info.layout
        self._space = self._actor.space
        self._objects = objects_by_id(info.objects, self._values.objects, config.task)
        if hash_of(self._objects.values()) != info.data:
            raise RunError("an object has changed since the run began: train anew, in another folder")
        self._env = ManipulationVectorEnv(
            self._values.envs,
            config.task,
            objects=list(self._objects.values()),
            obs_mode="pointcloud",
            num_threads=1,
            copy=False,
            autoreset_mode="disabled",
        )
        sampling = Sampling(**info.sampling)
        VectorPointCloudDownsample(
            self._env, sampling.method, sampling.num_points, sampling.frame, **sampling.settings
        )
        self._task: Task = self._env.task
        self._expert = commanding_expert(self._task, self._values.expert)
        self._half_range = self._expert.controller.whole_body.scale.half_range
        self._pushes = load_variation(config.task).disturbance
        self._kinds = kinds_of(info.objects)
        self._rng = np.random.default_rng()
        self._policy: Any = None
        self._episodes: list[_Episode] = []
        self._elapsed = np.zeros(self._values.envs, dtype=np.int64)
        self._seen: Any = None

    def run(self, job: RolloutJob, send: Send) -> tuple[np.ndarray, np.ndarray, Counts]:
        """Return records and labels of what was met, and what came of it."""
        begin, values = time.perf_counter(), self._values
        self._rng = np.random.default_rng([self._config.seed, _PRIVATE_STREAM, job.round, job.collector])
        self._policy = self._load(job) if job.round >= values.expert_rounds else None
        self._begin(np.ones(values.envs, dtype=bool))
        met, totals, labelling_s = [], np.zeros(4), 0.0
        for step in range(values.rollout_steps):
            asked = time.perf_counter()
            labels, is_good = self._labels()
            labelling_s += time.perf_counter() - asked
            met.append(_Met(self._records(), labels, is_good))
            totals += self._advance(met[-1])
            if step % _MESSAGE_STEPS == 0:
                send(None)
        records = np.concatenate([one.records[one.is_good] for one in met])
        labels = np.concatenate([one.labels[one.is_good] for one in met])
        counts = Counts._make((len(labels), *totals.tolist(), time.perf_counter() - begin, labelling_s))
        return records, labels, counts

    def _load(self, job: RolloutJob) -> Any:
        algorithm = make_algorithm(self._config, self._info)
        load_weights(job.policy, algorithm)
        return algorithm.requires_grad_(False).eval()

    def _begin(self, mask: np.ndarray) -> None:
        """Begin episodes in some environments, (B,) bool."""
        self._episodes = [self._episode() if mask[env] else self._episodes[env] for env in range(len(mask))]
        self._elapsed[mask] = 0
        options = {"level": self._rng.integers(*_LEVELS, size=len(mask)).tolist(), "reset_mask": mask}
        if self._values.generated_share is not None:
            options["object"] = [self._objects[self._drawn(self._values.generated_share)] for _ in mask]
        self._seen, _ = self._env.reset(options=options)

    def _drawn(self, generated_share: float) -> str:
        """Return the id of a generated object, or of one of the others."""
        names = self._kinds[int(self._rng.random() < generated_share)]
        return names[self._rng.integers(len(names))]

    def _episode(self) -> _Episode:
        values, steps, is_whole = self._values, 0, False
        if self._policy is not None:
            is_whole = bool(self._rng.random() < values.whole_share)
            low, high = values.takeover_steps
            steps = self._task.config.episode_steps if is_whole else int(self._rng.integers(low, high + 1))
        arms = len(self._task.robot.mounts)
        own = np.random.default_rng(int(self._rng.integers(2**62)))
        disturbance = Disturbance(self._pushes, self._half_range, arms, self._space.step_s, own)
        return _Episode(steps, is_whole, disturbance)

    def _records(self) -> np.ndarray:
        cloud = self._seen["pointcloud"]
        return self._layout.encode(cloud["xyz"], cloud["rgb"], cloud["seg"], self._seen["agent"])

    def _labels(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the expert's commands (B, V), and where it has one."""
        snapshots, goals = self._env.get_attr("snapshot"), self._env.get_attr("goal")
        labels = np.zeros((len(goals), self._space.label_size), dtype=np.float32)
        is_good = np.ones(len(goals), dtype=bool)
        for env, (snapshot, goal) in enumerate(zip(snapshots, goals, strict=True)):
            try:
                labels[env] = self._space.encode(self._expert.command(snapshot, goal))
            except FAULTS:
                is_good[env] = False
        return labels, is_good & np.isfinite(labels).all(axis=1)

    def _advance(self, met: _Met) -> np.ndarray:
        """Act; return how many episodes the expert has ended, and solved, and how many the policy, likewise."""
        by_policy = self._elapsed < [episode.policy_steps for episode in self._episodes]
        labels = met.labels
        if by_policy.any():
            seen = Observation(*map(torch.from_numpy, self._layout.decode(met.records)))
            labels = np.where(by_policy[:, None], self._policy.act(seen).numpy(), labels)
        solved, done = self._step(self._actions(met, labels, by_policy))
        self._elapsed += 1
        done |= ~met.is_good
        is_whole = np.array([episode.is_whole for episode in self._episodes])
        expert = ~is_whole & ~by_policy  # what the policy solves before the expert takes over is of neither
        counts = [(done & who & what).sum() for who in (expert, is_whole) for what in (True, solved)]
        if done.any():
            self._begin(done)
        return np.array(counts)

    def _actions(self, met: _Met, labels: np.ndarray, by_policy: np.ndarray) -> np.ndarray:
        """Return (B, R): commands carried out, and disturbed where the expert commands."""
        actions, agent = np.zeros((len(labels), len(self._half_range))), met.records["agent"]
        for env in np.flatnonzero(met.is_good).tolist():
            actions[env] = self._actor.action(agent[env], labels[env])
            offset = None if by_policy[env] else self._episodes[env].disturbance.next(actions[env])
            if offset is not None:
                actions[env] = np.clip(actions[env] + offset, -1.0, 1.0)
        return actions

    def _step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (B,) bool each: which episodes are solved, which are over; all, where physics diverges."""
        try:
            self._seen, _, solved, out_of_time, _ = self._env.step(actions)
        except DivergedError:
            return np.zeros(len(actions), dtype=bool), np.ones(len(actions), dtype=bool)
        return solved, solved | out_of_time
