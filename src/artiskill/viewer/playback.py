"""Episodes as timelines of moments, a person who acts, and `Player`, which decides what is shown; no browser.

A live episode grows while it is watched; a demonstration has all of its steps. Both can be scrubbed through.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.demos.demo_file import DemoFile, Trajectory
from artiskill.demos.demonstrator import FAULTS, fault_text
from artiskill.demos.recording import digest_of
from artiskill.envs.control import OPERATIONAL, Control
from artiskill.envs.core import ObservationContext
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.state import EnvState
from artiskill.errors import DemoError, PolicyError, check_name
from artiskill.evaluation.pictures import EpisodeChoice
from artiskill.evaluation.policies import Actor, load_policy, policy_of_task
from artiskill.geometry.rotations import quat_conjugate, quat_from_matrix, quat_multiply, quat_to_rotation_vector
from artiskill.robots.operational_space import TRUNK
from artiskill.scene.scene import Scene
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.levels import check_level
from artiskill.tasks.task import Task

SPEEDS = {"1/8": 0.125, "1/4": 0.25, "1/2": 0.5, "1": 1.0, "2": 2.0, "4": 4.0}  # times as fast as life
# share of a hand's way that it is asked to go per second, and of its greatest velocity that it is asked for
_HAND_GAIN_S, _HAND_SHARE = 4.0, 0.5
_PUSH_STEPS, _BRAKE_STEPS = 3, 2  # for which a push drives the trunk, and in which it then comes to rest
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
        state: what the episode can be gone on with from here.
    """

    context: ObservationContext
    reward: float
    reward_terms: Mapping[str, float]
    flags: Mapping[str, bool]
    progress: str
    end: str
    state: EnvState


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

    def close(self) -> None:
        """End what belongs to the episode: a solution's process, say."""


class HandActor(Actor):
    """A person who drives the robot: hands go to poses, the trunk goes where it is pushed.

    Actions come about through the control mode `operational_space`, whichever the environment has.

    Args:
        env: whose robot is driven.

    Attributes:
        positions_w: (A, 3) where the hands shall be.
        quaternions_w: (A, 4) likewise.
        opening_m: of all fingers, each from the middle.
        has_moved_on: whether the wanted poses have gone with the trunk; who has seen it sets it back.
    """

    name = "by hand"

    def __init__(self, env: ManipulationEnv) -> None:
        self._control = Control(env.task.robot, OPERATIONAL)
        self._trunk_share, self._steps = np.zeros(TRUNK), 0
        self.opening_m = float(self._control.scale.center[-1])
        self._stay(env.snapshot)

    def reset(self, env: ManipulationEnv, observation: Any, info: dict[str, Any]) -> None:
        """Begin where the robot is, and stay there."""
        self._steps = 0
        self._stay(env.snapshot)

    def _stay(self, snapshot: Snapshot) -> None:
        self.has_moved_on = True
        self.positions_w = snapshot.tool_position_w[0].copy()
        self.quaternions_w = np.stack([quat_from_matrix(turn) for turn in snapshot.tool_rotation_w[0]])

    def push(self, trunk_share: Sequence[float]) -> None:
        """Push the trunk for a moment; the hands go with it.

        Args:
            trunk_share: (4,) base forward, to its left, yaw to the left and lift, shares of the greatest velocity.
        """
        self._trunk_share, self._steps = np.asarray(trunk_share, dtype=float), _PUSH_STEPS + _BRAKE_STEPS

    def act(self, env: ManipulationEnv, observation: Any) -> np.ndarray:
        """Return the next action, (A,)."""
        snapshot, scale = env.snapshot, self._control.scale
        values = scale.center.copy()
        arms = values[TRUNK:].reshape(len(self.positions_w), -1)
        arms[:, -2:] = self.opening_m
        if self._steps:
            if self._steps > _BRAKE_STEPS:
                values[:TRUNK] = self._trunk_share * scale.half_range[:TRUNK]
            self._steps -= 1
            self._stay(snapshot)
        else:
            arms[:, :6] = self._twists(snapshot)
        targets = self._control.to_targets(scale.to_actions(values)[None], snapshot)
        action: np.ndarray = env.control.to_actions(targets, snapshot)[0]
        return action

    def close(self) -> None:
        """Do nothing: a person has no process."""
        return

    def _twists(self, snapshot: Snapshot) -> np.ndarray:
        """Return (A, 6) velocities, in the hands' own axes, that lead towards the wanted poses."""
        turns = snapshot.tool_rotation_w[0]
        back = np.stack([quat_conjugate(quat_from_matrix(turn)) for turn in turns])
        linear = np.einsum("aji,aj->ai", turns, self.positions_w - snapshot.tool_position_w[0])
        angular = quat_to_rotation_vector(quat_multiply(back, self.quaternions_w))
        twists = _HAND_GAIN_S * np.concatenate((linear, angular), axis=1)
        half = self._control.scale.half_range[TRUNK:].reshape(len(turns), -1)[:, :6]
        excess = np.abs(twists / half).max(axis=1, keepdims=True)
        return twists / np.maximum(excess / _HAND_SHARE, 1.0)  # slower, but in the same direction


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
        level = check_level(choice.level)
        self._actor: Actor = load_policy(policy_of_task(choice.policy, choice.task), choice.task)
        self._env = choice.make_env(self._actor)
        self._observation, info = self._env.reset(options={"level": level})
        self._actor.reset(self._env, self._observation, info)
        self.hand, self.by_hand = HandActor(self._env), False
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
            action = (self.hand if self.by_hand else self._actor).act(self._env, self._observation)
            self._observation, reward, terminated, truncated, info = self._env.step(action)
        except (PolicyError, *FAULTS) as error:
            self.is_complete = True
            self._moments[-1] = replace(self._moments[-1], end=fault_text(error))
            return
        if terminated or truncated:
            self.is_complete, end = True, SOLVED if info["success"] else NOT_SOLVED
        self._moments.append(_moment(self._env, reward, info, end))

    def close(self) -> None:
        """End what belongs to the policy."""
        self._actor.close()

    def take_over(self, step: int, by_hand: bool) -> None:
        """Go on from a step with a person or the policy; what came after it is forgotten.

        Raises:
            PolicyError: the policy cannot begin there.
        """
        del self._moments[step + 1 :]
        last = self._moments[-1]
        self._observation, info = self._env.restore_state(last.state)
        self.by_hand = by_hand
        self.is_complete = info["success"] or last.state.elapsed >= self.task.config.episode_steps
        if not self.is_complete and last.end:  # a fault, of which there may be none now
            self._moments[-1] = replace(last, end="")
        (self.hand if by_hand else self._actor).reset(self._env, self._observation, info)


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

    def close(self) -> None:
        """Do nothing: nobody acts."""
        return

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
        state=state,
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
