"""Episodes that have been played before: demonstrations, and those of a report, in their exact states."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.demos.demo_file import DemoFile, Trajectory
from artiskill.demos.demonstrator import FAULTS, fault_text
from artiskill.demos.recording import digest_of
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ConfigError, DemoError
from artiskill.evaluation.action_replay import final_digest
from artiskill.evaluation.statistics import EpisodeResult
from artiskill.viewer.playback import NOT_SOLVED, SOLVED, Moment, Timeline, moment_of


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
        self._moments[step] = moment_of(self._env, reward, info, end)


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
        f"demonstration {number} of {len(file)} by {settings.expert.name}"
    )
    return RecordedEpisode(trajectory, file.make_env(obj=given), title)


class ReportedEpisode(Timeline):
    """An episode of a report: its actions are played again, to the same states, bit for bit.

    Args:
        env: in which it was played, without observations.
        actions: (T, A).
        result: what the report says of it.
        policy: who chose the actions.

    Raises:
        ConfigError: this version's physics comes to another end than the report.
    """

    is_complete = True

    def __init__(self, env: ManipulationEnv, actions: np.ndarray, result: EpisodeResult, policy: str) -> None:
        _, info = env.reset(options={"level": result.level})
        self._moments = [moment_of(env, 0.0, info)]
        fault = result.fault
        for action in actions:
            try:
                _, reward, _, _, info = env.step(action)
            except FAULTS as error:
                fault = fault_text(error)
                break
            self._moments.append(moment_of(env, reward, info))
        found = "" if fault else final_digest(env.save_state())
        if found != result.digest:
            raise ConfigError(
                f"{result.object}, level {result.level}: the episode ends otherwise than the report says: "
                "`artiskill report verify` says more"
            )
        end = fault or (SOLVED if result.success else NOT_SOLVED)
        self._moments[-1] = replace(self._moments[-1], end=end)
        self.task, self.scene, self.target = env.task, env.scene, info["target"]
        self.title = f"{env.task.name}: {result.object}, {self.target}, level {result.level}, {policy}"

    def __len__(self) -> int:
        return len(self._moments)

    def moment(self, step: int) -> Moment:
        """Return the moment after some steps."""
        return self._moments[step]

    def extend(self) -> None:
        """Do nothing: all steps are there."""

    def close(self) -> None:
        """Do nothing: nobody acts."""
        return
