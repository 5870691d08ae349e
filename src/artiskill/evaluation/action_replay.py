"""A report's actions: as a file, and episodes played again by them alone, without policy and observations.

Played again, an episode has the same bits.
"""

import hashlib
import io
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from artiskill.demos.demonstrator import fault_kind, fault_text
from artiskill.demos.recording import digest_of
from artiskill.envs.control import Control
from artiskill.envs.core import Episodes
from artiskill.envs.sampling import EpisodeSampler
from artiskill.envs.state import EnvState, save_episode
from artiskill.errors import DivergedError
from artiskill.evaluation.plan import EpisodeBatch, EvaluationPlan
from artiskill.evaluation.statistics import EpisodeResult
from artiskill.files import DAMAGED_ARCHIVE, check_archive
from artiskill.jobs.worker import Send
from artiskill.tasks.registry import make_task

# what may end an episode besides the physics: a policy of this package that fails at its arithmetic
_POLICY_FAULTS = ("ArithmeticError", "FloatingPointError", "OverflowError", "ZeroDivisionError", "LinAlgError")
_JOB_EPISODES = 25
MOST_ACTION_BYTES = 1_000_000_000  # of all actions of a report: a thousand times what 50 episodes have


def join_actions(actions: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the number of actions of each episode, (E,) int32, and all of them, (N, A), without loss.

    They are float32 if all of them have such values, else float64.

    Args:
        actions: (T, A) of each episode, all with the same A.
    """
    lengths = np.array([len(one) for one in actions], dtype="<i4")
    exact = np.concatenate(list(actions)).astype("<f8")
    short = exact.astype("<f4")
    return lengths, short if short.astype("<f8").tobytes() == exact.tobytes() else exact


def actions_sha256(lengths: np.ndarray, actions: np.ndarray) -> str:
    """Return the SHA-256 of all actions as numbers, however a file compresses them."""
    shape = f"{len(lengths)} {actions.shape} {actions.dtype.str}\n".encode()
    return hashlib.sha256(shape + lengths.tobytes() + actions.tobytes()).hexdigest()


def pack_actions(actions: Sequence[np.ndarray]) -> bytes:
    """Return the file of all actions, an `.npz`.

    `lengths` (E,) are the episodes' numbers of actions. `planes` (A, bytes, N) has the first bytes of all numbers
    of a column one after the other, then the second ones, and so on: like bytes side by side compress better.
    """
    lengths, joined = join_actions(actions)
    planes = joined.view(np.uint8).reshape(*joined.shape, joined.itemsize).transpose(1, 2, 0)
    file = io.BytesIO()
    np.savez_compressed(file, lengths=lengths, planes=np.ascontiguousarray(planes))
    return file.getvalue()


def unpack_actions(file: bytes, most_bytes: int = MOST_ACTION_BYTES) -> list[np.ndarray]:
    """Return the actions of each episode, (T, A) float64, of a `pack_actions` file that is no larger unpacked.

    Raises:
        ValueError: it is no such file, or too large, or holds numbers that are no actions.
    """
    content = io.BytesIO(file)
    try:
        check_archive(content, most_bytes)
        with np.load(content, allow_pickle=False) as arrays:
            names, lengths, planes = sorted(arrays.files), arrays["lengths"], arrays["planes"]
    except ValueError:  # which says it itself
        raise
    except DAMAGED_ARCHIVE as error:
        raise ValueError(f"it is damaged ({type(error).__name__})") from error
    is_ours = lengths.dtype == "<i4" and lengths.ndim == 1 and planes.dtype == np.uint8 and planes.ndim == 3
    is_ours = is_ours and names == ["lengths", "planes"] and planes.shape[1] in (4, 8)
    if not is_ours or (lengths < 0).any() or lengths.sum() != planes.shape[2]:
        raise ValueError("its arrays do not fit together")
    numbers = np.ascontiguousarray(planes.transpose(2, 0, 1)).view(f"<f{planes.shape[1]}")[..., 0].astype("<f8")
    if not (np.abs(numbers) <= 1.0).all():
        raise ValueError("it holds numbers that are not in [-1, 1]")
    return np.split(numbers, np.cumsum(lengths, dtype=np.int64)[:-1])


@dataclass(frozen=True, eq=False)
class ReplayJob:
    """Episodes that are to be played by their actions.

    Attributes:
        batch: of episodes; nobody asks for its policy.
        actions: (T, A) of each of its levels.
        faults: what ended each of them, as a report says.
    """

    batch: EpisodeBatch
    actions: tuple[np.ndarray, ...]
    faults: tuple[str, ...]


def replay_jobs(
    plan: EvaluationPlan, actions: Sequence[np.ndarray], faults: Sequence[str], chosen: Collection[int]
) -> list[ReplayJob]:
    """Return jobs that play episodes of a plan again, in their order.

    Args:
        plan: of the report.
        actions: of all its episodes, row by row.
        faults: what ended each of them, as a report says.
        chosen: which of them are played.
    """
    jobs, first = [], 0
    for batch in plan.batches:
        places = [first + k for k in range(len(batch.levels)) if first + k in chosen]
        for start in range(0, len(places), _JOB_EPISODES):
            part = places[start : start + _JOB_EPISODES]
            levels = tuple(batch.levels[place - first] for place in part)
            of_part = tuple(actions[place] for place in part), tuple(faults[place] for place in part)
            jobs.append(ReplayJob(replace(batch, levels=levels), *of_part))
        first += len(batch.levels)
    return jobs


def replay(job: ReplayJob, send: Send) -> tuple[list[EpisodeResult], list[str]]:
    """Play all episodes of a job side by side, bit for bit as `run_episode` does one, without observations.

    Returns:
        Their outcomes, and a text for each whose actions go on when it is over.
    """
    player = ActionReplay(job, send)
    while not player.over.all():
        player.step()
    return [player.results[env] for env in range(len(job.actions))], player.notes


class ActionReplay:
    """Episodes on one object that are played by their actions; those that are over rest.

    Args:
        job: which.
        send: called with the outcome of each.

    Attributes:
        episodes: as they stand.
        over: (B,) bool.
        results: of those that are over, by their place in the job.
        notes: a text for each whose actions go on when it is over.
    """

    def __init__(self, job: ReplayJob, send: Send) -> None:
        batch, count = job.batch, len(job.actions)
        task = make_task(batch.task, batch.overrides)
        control = Control(task.robot, batch.control_mode)
        self.episodes = Episodes(task, control, [EpisodeSampler(task, [batch.object], batch.target)] * count, 1)
        self._job, self._send, self._steps = job, send, 0
        self._reward_sums = [0.0] * count
        self.over = np.zeros(count, dtype=bool)
        self.results: dict[int, EpisodeResult] = {}
        self.notes: list[str] = []
        nothing = [None] * count
        self.episodes.start(range(count), batch.levels, nothing, nothing)

    def step(self) -> None:
        """Take one step in all episodes that are not over."""
        episodes, rows = self.episodes, np.zeros((len(self.over), self.episodes.control.size))
        for env in np.flatnonzero(~self.over).tolist():
            if self._steps == len(self._job.actions[env]):
                self._end_without_action(env)
            else:
                rows[env] = self._job.actions[env][self._steps]
        if self.over.all():
            return
        resting = self.over.copy()
        diverged = episodes.step(rows, resting if resting.any() else None)
        for env, cause in diverged.items():
            self._finish(env, fault_text(DivergedError({0: cause})), self._steps + 1)
            episodes.start([env], [self._job.batch.levels[env]], [None], [None])  # numbers that can be looked at
        episodes.evaluate()
        episodes.advance(~resting)
        rewards, terminated, truncated = episodes.outcome(True, resting if resting.any() else None)
        self._steps += 1
        for env in np.flatnonzero(~self.over).tolist():
            self._reward_sums[env] += float(rewards[env])
            if terminated[env] or truncated[env]:
                self._finish(env, "", self._steps)

    def _end_without_action(self, env: int) -> None:
        """End an episode that has no more actions, which is in order if its policy failed there."""
        fault = self._job.faults[env]
        if fault_kind(fault) not in _POLICY_FAULTS:
            fault = "the actions end before the episode does"
        self._finish(env, fault, self._steps)

    def _finish(self, env: int, fault: str, used: int) -> None:
        """Keep the outcome of an episode.

        Args:
            env: which.
            fault: what ended it, if anything did.
            used: actions that were played.
        """
        episodes, actions = self.episodes, self._job.actions[env]
        names, counted = episodes.task.flag_names, episodes.counted[env].tolist()
        result = EpisodeResult(
            object=episodes.objects[env],
            target=episodes.targets[env],
            level=int(episodes.levels[env]),
            success=all(counted) and not fault,
            length=self._steps,
            flags=dict.fromkeys(names, False) if fault else dict(zip(names, counted, strict=True)),
            fault=fault,
            reward_sum=self._reward_sums[env],
            digest="" if fault else final_digest(save_episode(episodes, env)),
            actions=actions,
        )
        if used != len(actions):
            where = f"{result.object}, target {result.target}, level {result.level}"
            self.notes.append(f"{where}: the episode ends after {used} of {len(actions)} actions")
        self.over[env], self.results[env] = True, result
        self._send(result)


def final_digest(state: EnvState) -> str:
    """Return the digest of an episode's last state, as reports have it: it depends on every action before."""
    return f"{digest_of(state.simulation):016x}"
