"""Episodes as timelines of moments, a person who acts, and `Player`, which decides what is shown; no browser.

A live episode grows while it is watched; a demonstration and an episode of a report have all of their steps. All
can be scrubbed through.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from artiskill.demos.by_hand import add_demonstration, check_recording
from artiskill.demos.demonstrator import FAULTS, fault_text
from artiskill.envs.core import ObservationContext
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.state import EnvState
from artiskill.errors import PolicyError, check_name
from artiskill.evaluation.pictures import EpisodeChoice
from artiskill.evaluation.policies import Actor, load_policy, policy_of_task
from artiskill.scene.scene import Scene
from artiskill.sim.simulation import Contacts
from artiskill.tasks.levels import check_level
from artiskill.tasks.registry import make_task
from artiskill.tasks.task import Task
from artiskill.viewer.driving import HandActor

SPEEDS = {"1/8": 0.125, "1/4": 0.25, "1/2": 0.5, "1": 1.0, "2": 2.0, "4": 4.0}  # times as fast as life
# steps that one update catches up with, and how long it may take for them; who is slower falls behind
_MOST_DUE, _MOST_S = 8, 0.04
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
        state: what the episode can be gone on with from here.
    """

    context: ObservationContext
    reward: float
    reward_terms: Mapping[str, float]
    flags: Mapping[str, bool]
    progress: str
    end: str
    state: EnvState


def contact_text(contacts: Contacts) -> str:
    """Return how many contacts there are and how hard they press, as Markdown."""
    forces = np.linalg.norm(contacts.force_w, axis=1)
    if not len(forces):
        return "no contacts"
    return f"{len(forces)} contacts; the strongest {forces.max():.1f} N, together {forces.sum():.1f} N"


def state_text(moment: Moment) -> str:
    """Return how far an episode has come, and which flags count, as Markdown."""
    context = moment.context
    seconds = context.elapsed * context.snapshot.step_s
    parts = [f"**step {context.elapsed}** ({seconds:.2f} s)", moment.progress, moment.end and f"**{moment.end}**"]
    flags = [f"{_YES if held else _NO}&nbsp;{name}" for name, held in moment.flags.items()]
    return "\n\n".join((" · ".join(part for part in parts if part), " &nbsp; ".join(flags)))


def reward_text(moment: Moment) -> str:
    """Return the reward and its unweighted terms, as Markdown."""
    rows = [f"| {name} | {value:.3f} |" for name, value in moment.reward_terms.items()]
    return "\n".join(["| | |", "|:--|--:|", f"| **reward** | **{moment.reward:.3f}** |", *rows])


def moment_of(env: ManipulationEnv, reward: float, info: Mapping[str, Any], end: str = "") -> Moment:
    """Return the moment that an environment is at, with the reward and info of the step that led there."""
    state = env.save_state()
    describe = env.task.describe_progress
    return Moment(
        context=ObservationContext(env.snapshot, env.goal, 0, state.level, state.elapsed),
        reward=float(reward),
        reward_terms=dict(info["reward_terms"]),
        flags=dict(info["flags"]),
        progress="" if describe is None else describe(env.snapshot, env.goal),
        end=end,
        state=state,
    )


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

    def close(self) -> None:
        """End what belongs to the episode: a solution's process, say."""


class LiveEpisode(Timeline):
    """An episode that a policy plays while it is watched; a person can take over at any step, and hand back.

    Args:
        choice: which episode, and who acts.

    Attributes:
        hand: what a person asks for.
        by_hand: whether a person acts.

    Raises:
        UnknownNameError: an unknown task, object, target link or policy.
        ConfigError: a level or configuration value that is not legal.
        AssetError: an object that cannot be read or used for the task.
        PolicyError: a policy that cannot be used.
    """

    def __init__(self, choice: EpisodeChoice) -> None:
        self._choice, level = choice, check_level(choice.level)
        self._actor: Actor = load_policy(policy_of_task(choice.policy, choice.task), choice.task)
        self._env = choice.make_env(self._actor)
        self._observation, info = self._env.reset(options={"level": level})
        self._actor.reset(self._env, self._observation, info)
        self.hand, self.by_hand = HandActor(self._env), False
        self.task, self.scene, self.target = self._env.task, self._env.scene, info["target"]
        self.title = f"{self.task.name}: {info['object']}, {self.target}, level {level}, {choice.policy}"
        self.is_complete = False
        self._moments = [moment_of(self._env, 0.0, info)]
        self._actions: list[
            tuple[np.ndarray, bool]
        ] = []  # that led to the moments, and whether a person chose them

    def __len__(self) -> int:
        return len(self._moments)

    def moment(self, step: int) -> Moment:
        """Return the moment after some steps."""
        return self._moments[step]

    def extend(self) -> None:
        """Let the policy take one more step; its errors and the physics' end the episode."""
        reward, end = 0.0, ""
        try:
            action = (self.hand if self.by_hand else self._actor).act(self._env, self._observation)
            self._observation, reward, terminated, truncated, info = self._env.step(action)
        except (PolicyError, *FAULTS) as error:
            self._end_by(error)
            return
        if terminated or truncated:
            self.is_complete, end = True, SOLVED if info["success"] else NOT_SOLVED
        self._moments.append(moment_of(self._env, reward, info, end))
        self._actions.append((np.asarray(action), self.by_hand))

    def _end_by(self, error: Exception) -> None:
        self.is_complete = True
        self._moments[-1] = replace(self._moments[-1], end=fault_text(error))

    @property
    def was_driven(self) -> bool:
        """Whether a person has acted up to now."""
        return any(by_hand for _, by_hand in self._actions)

    def check_store(self, folder: Path) -> None:
        """Raise `ArtiSkillError` if episodes like this could not be stored in a folder."""
        check_recording(folder, make_task(self._choice.task, self._choice.config), self._env.control.mode)

    def store(self, folder: Path) -> str:
        """Add the episode, which was solved, to a folder of demonstrations by hand; return where it is.

        Raises:
            ArtiSkillError: it cannot be stored there; see `add_demonstration`.
        """
        task = make_task(self._choice.task, self._choice.config)
        actions, by_hand = (np.array(values) for values in zip(*self._actions, strict=True))
        path, number = add_demonstration(folder, task, self._env, actions, by_hand)
        return f"demonstration {number} in {path}"

    def close(self) -> None:
        """End what belongs to the policy."""
        self._actor.close()

    def take_over(self, step: int, by_hand: bool) -> None:
        """Go on from a step with a person or the policy; what came after it is forgotten.

        A policy that cannot begin there ends the episode, as its other errors do.
        """
        del self._moments[step + 1 :], self._actions[step:]
        last = self._moments[-1]
        self._observation, info = self._env.restore_state(last.state)
        self.by_hand = by_hand
        self.is_complete = info["success"] or last.state.elapsed >= self.task.config.episode_steps
        if not self.is_complete and last.end:  # a fault, of which there may be none now
            self._moments[-1] = replace(last, end="")
        if self.is_complete:
            return
        try:
            (self.hand if by_hand else self._actor).reset(self._env, self._observation, info)
        except (PolicyError, *FAULTS) as error:
            self._end_by(error)


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
        self._previous, self._since_s = 0, clock()

    @property
    def moment(self) -> Moment:
        """Return what is shown."""
        return self.timeline.moment(self.position)

    def between(self) -> tuple[Moment, Moment, float]:
        """Return two moments, and how far time has come from the first to the second, in [0, 1].

        While it plays, what is drawn comes a step later, and without jerks: steps are fewer than pictures.
        """
        share = (self._clock() - self._since_s) / self._interval_s if self.is_playing else 1.0
        return self.timeline.moment(self._previous), self.moment, min(max(share, 0.0), 1.0)

    @property
    def _interval_s(self) -> float:
        return self.moment.context.snapshot.step_s / SPEEDS[self.speed]

    @property
    def at_end(self) -> bool:
        """Return whether no later moment exists or can come."""
        return self.timeline.is_complete and self.position == len(self.timeline) - 1

    def play(self) -> None:
        """Go on from here; from the end, begin again."""
        if self.at_end:
            self.position = 0
        self._previous = self.position
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
        now, interval_s = self._clock(), self._interval_s
        due = int((now - self._since_s) / interval_s)
        if not due:
            return False
        before, wanted = self.position, min(due, _MOST_DUE)
        while self.position < before + wanted and not self.at_end and self._clock() - now < _MOST_S:
            self._go_to(self.position + 1)
        is_late = self.position < before + due
        self._since_s = self._clock() if is_late else self._since_s + due * interval_s
        self._previous = before
        if self.at_end:
            self.pause()
        return self.position != before or not self.is_playing

    def _go_to(self, position: int) -> None:
        while position >= len(self.timeline) and not self.timeline.is_complete:
            self.timeline.extend()
        position = min(max(position, 0), len(self.timeline) - 1)
        for step in range(self.position + 1, position + 1):
            self.timeline.moment(step)  # an error of any step on the way leaves all as it is
        self.position = self._previous = position
