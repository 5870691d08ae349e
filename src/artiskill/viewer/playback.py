"""Episodes as timelines of moments, and `Player`, which decides which moment is shown; no browser is needed.

A live episode grows while it is watched; a demonstration has all of its steps. Both can be scrubbed through.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.demos.demo_file import DemoFile, Trajectory
from artiskill.demos.demonstrator import FAULTS, fault_text
from artiskill.demos.recording import digest_of
from artiskill.envs.core import ObservationContext
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import DemoError, PolicyError, check_name
from artiskill.evaluation.pictures import EpisodeChoice
from artiskill.evaluation.policies import Actor, load_policy
from artiskill.scene.scene import Scene
from artiskill.tasks.levels import check_level
from artiskill.tasks.task import Task

SPEEDS = {"1/8": 0.125, "1/4": 0.25, "1/2": 0.5, "1": 1.0, "2": 2.0, "4": 4.0}  # times as fast as life
_MOST_DUE = 8  # steps that one update catches up with; who is slower falls behind
_YES, _NO = "\u2611", "\u2610"  # ballot boxes, with and without a check
SOLVED, NOT_SOLVED = "solved", "not solved"


@dataclass(frozen=True, eq=False)
class Moment:
    """An episode after some steps.

    Attributes:
        context: snapshot and goal with B = 1, level, steps so far.
        reward: dense reward of the step that led here; 0 at the first state.
        reward_terms: name -> unweighted value.
        flags: condition -> whether it counts by now.
        progress: how far the episode has come, as captions say it; empty where the task says nothing.
        end: `solved`, `not solved` or what went wrong, if the episode ends here; else empty.
    """

    context: ObservationContext
    reward: float
    reward_terms: Mapping[str, float]
    flags: Mapping[str, bool]
    progress: str
    end: str


def state_text(moment: Moment) -> str:
    """Return how far an episode has come, and which flags count, as Markdown."""
    context = moment.context
    seconds = context.elapsed * context.snapshot.step_s
    parts = [f"**step {context.elapsed}** ({seconds:.2f} s)", moment.progress, moment.end and f"**{moment.end}**"]
    flags = [f"{_YES if held else _NO} {name}" for name, held in moment.flags.items()]
    return "\n\n".join((" · ".join(part for part in parts if part), " &nbsp; ".join(flags)))


def reward_text(moment: Moment) -> str:
    """Return the reward and its unweighted terms, as Markdown."""
    rows = [f"| {name} | {value:.3f} |" for name, value in moment.reward_terms.items()]
    return "\n".join(["| | |", "|:--|--:|", f"| **reward** | **{moment.reward:.3f}** |", *rows])


class Timeline(Protocol):
    """The moments of one episode.

    Attributes:
        task: what is asked.
        scene: what is simulated.
        target: the target link.
        title: what episode it is, in a line.
        is_complete: whether no more moments will come.
    """

    task: Task
    scene: Scene
    target: str
    title: str
    is_complete: bool

    def __len__(self) -> int:
        """Return the number of moments that are known, at least 1."""

    def moment(self, step: int) -> Moment:
        """Return the moment after some steps, less than the length."""

    def extend(self) -> None:
        """Take one more step, where the timeline is not complete."""


class LiveEpisode(Timeline):
    """An episode that a policy plays while it is watched.

    Args:
        choice: which episode, and who acts.

    Raises:
        UnknownNameError: an unknown task, object, target link or policy.
        ConfigError: a level or configuration value that is not legal.
        AssetError: an object that cannot be read or used for the task.
        PolicyError: a policy that cannot be used.
    """

    def __init__(self, choice: EpisodeChoice) -> None:
        level = check_level(choice.level)
        self._actor: Actor = load_policy(choice.policy)
        self._env = choice.make_env(self._actor)
        self._observation, info = self._env.reset(options={"level": level})
        self._actor.reset(self._env, self._observation, info)
        self.task, self.scene, self.target = self._env.task, self._env.scene, info["target"]
        self.title = f"{self.task.name}: {info['object']}, {self.target}, level {level}, {choice.policy}"
        self.is_complete = False
        self._moments = [_moment(self._env, 0.0, info)]

    def __len__(self) -> int:
        return len(self._moments)

    def moment(self, step: int) -> Moment:
        """Return the moment after some steps."""
        return self._moments[step]

    def extend(self) -> None:
        """Let the policy take one more step; its errors and the physics' end the episode."""
        reward, end = 0.0, ""
        try:
            action = self._actor.act(self._env, self._observation)
            self._observation, reward, terminated, truncated, info = self._env.step(action)
        except (PolicyError, *FAULTS) as error:
            self.is_complete = True
            self._moments[-1] = replace(self._moments[-1], end=fault_text(error))
            return
        if terminated or truncated:
            self.is_complete, end = True, SOLVED if info["success"] else NOT_SOLVED
        self._moments.append(_moment(self._env, reward, info, end))


class RecordedEpisode(Timeline):
    """A demonstration, whose states are the recorded ones, bit for bit.

    Args:
        trajectory: the demonstration.
        env: of its file, see `DemoFile.make_env`.
        title: which it is, in a line.

    Raises:
        DemoError: its first state is damaged.
        StateError: the environment is of another task, object or physics.
    """

    is_complete = True

    def __init__(self, trajectory: Trajectory, env: ManipulationEnv, title: str) -> None:
        self._trajectory, self._env, self.title = trajectory, env, title
        self._moments: dict[int, Moment] = {}
        self._restore_from(0)
        self.task, self.scene, self.target = env.task, env.scene, trajectory.target

    def __len__(self) -> int:
        return len(self._trajectory) + 1

    def moment(self, step: int) -> Moment:
        """Return the moment after some steps.

        Raises:
            DemoError: this version's physics comes to another state than the recorded one.
        """
        if step not in self._moments:
            self._restore_from(step)
        return self._moments[step]

    def extend(self) -> None:
        """Do nothing: all steps are there."""

    def _restore_from(self, step: int) -> None:
        """Simulate from the last stored state up to the next one; its moments are kept."""
        trajectory, env = self._trajectory, self._env
        frames = trajectory.exact_steps
        frame = int(np.searchsorted(frames, step, side="right")) - 1
        first = int(frames[frame])
        last = int(frames[frame + 1]) if frame + 1 < len(frames) else first
        _, info = env.restore_state(trajectory.env_state(first))
        self._keep(first, info)
        for k in range(first, last):
            _, _, _, _, info = env.step(trajectory.actions[k])
            found, wanted = digest_of(env.save_state().simulation), int(trajectory.recording.digests[k + 1])
            if found != wanted:
                raise DemoError(
                    f"{trajectory.name}: step {k + 1} is another one than was recorded: `artiskill demos verify` "
                    "says more"
                )
            self._keep(k + 1, info)

    def _keep(self, step: int, info: Mapping[str, Any]) -> None:
        trajectory = self._trajectory
        end = "" if step < len(trajectory) else SOLVED if trajectory.success else NOT_SOLVED
        reward = float(trajectory.rewards[step - 1]) if step else 0.0
        self._moments[step] = _moment(self._env, reward, info, end)


def recorded_episode(file: DemoFile, number: int, given: ArticulatedObject | None = None) -> RecordedEpisode:
    """Return a demonstration of a file.

    Args:
        file: open.
        number: of the demonstration.
        given: its object, where its own name does not lead to it.

    Raises:
        IndexError: there are not so many.
        DemoError: the demonstration is damaged, or its object or task has changed.
    """
    trajectory, settings = file.trajectory(number), file.header.settings
    title = (
        f"{settings.task}: {file.header.object}, {trajectory.target}, level {trajectory.level}, "
        f"demonstration {number} of {len(file)}"
    )
    return RecordedEpisode(trajectory, file.make_env(obj=given), title)


def _moment(env: ManipulationEnv, reward: float, info: Mapping[str, Any], end: str = "") -> Moment:
    state = env.save_state()
    describe = env.task.describe_progress
    return Moment(
        context=ObservationContext(env.snapshot, env.goal, 0, state.level, state.elapsed),
        reward=float(reward),
        reward_terms=dict(info["reward_terms"]),
        flags=dict(info["flags"]),
        progress="" if describe is None else describe(env.snapshot, env.goal),
        end=end,
    )


class Player:
    """Decides which moment of a timeline is shown: it plays, pauses, steps and jumps.

    Args:
        timeline: what is shown.
        clock: seconds; only differences count.

    Attributes:
        timeline: what is shown.
        position: number of the moment that is shown.
        is_playing: whether time goes on.
        speed: a key of `SPEEDS`.
    """

    def __init__(self, timeline: Timeline, clock: Callable[[], float] = time.monotonic) -> None:
        self.timeline, self._clock = timeline, clock
        self.position, self.is_playing, self.speed = 0, False, "1"
        self._since_s = clock()

    @property
    def moment(self) -> Moment:
        """Return what is shown."""
        return self.timeline.moment(self.position)

    @property
    def at_end(self) -> bool:
        """Return whether no later moment exists or can come."""
        return self.timeline.is_complete and self.position == len(self.timeline) - 1

    def play(self) -> None:
        """Go on from here; from the end, begin again."""
        if self.at_end:
            self.position = 0
        self.is_playing, self._since_s = True, self._clock()

    def pause(self) -> None:
        """Stay here."""
        self.is_playing = False

    def toggle(self) -> None:
        """Play if paused, else pause."""
        self.pause() if self.is_playing else self.play()

    def step(self, count: int = 1) -> None:
        """Pause, and go so many steps forward, or back if it is negative; a live episode takes steps for it."""
        self.pause()
        self._go_to(self.position + count)

    def seek(self, position: int) -> None:
        """Pause, and show a moment among those that are known, or the nearest."""
        self.pause()
        self._go_to(min(position, len(self.timeline) - 1))

    def set_speed(self, speed: str) -> None:
        """Play so many times as fast as life.

        Raises:
            UnknownNameError: not one of `SPEEDS`.
        """
        check_name("speed", speed, SPEEDS)
        self.speed, self._since_s = speed, self._clock()

    def update(self) -> bool:
        """Go on as far as the time since the last update asks for; return whether something is new."""
        if not self.is_playing:
            return False
        now, interval_s = self._clock(), self.moment.context.snapshot.step_s / SPEEDS[self.speed]
        due = int((now - self._since_s) / interval_s)
        if not due:
            return False
        self._since_s = self._since_s + due * interval_s if due <= _MOST_DUE else now
        before = self.position
        self._go_to(before + min(due, _MOST_DUE))
        if self.at_end:
            self.pause()
        return self.position != before or not self.is_playing

    def _go_to(self, position: int) -> None:
        while position >= len(self.timeline) and not self.timeline.is_complete:
            self.timeline.extend()
        self.position = min(max(position, 0), len(self.timeline) - 1)
