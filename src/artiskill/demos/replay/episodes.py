"""One trajectory once more, seen with other eyes: simulated from its level, or its states put in place."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.demos.demonstrator import Replay
from artiskill.demos.instants import digest_of
from artiskill.demos.replay.layout import TrajectoryWriter
from artiskill.demos.replay.retarget import Retarget, converted_at
from artiskill.demos.trajectory import Trajectory
from artiskill.envs.control import Control
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import DivergedError
from artiskill.scene.scene import cached_scene
from artiskill.sim.states import with_values

_DIGEST_STEPS = 10  # states are compared so often, and at the end: what differs once stays different


@dataclass(frozen=True)
class Outcome:
    """What came of a trajectory.

    Attributes:
        source: its number in the file of demonstrations.
        success: whether it is solved.
        exact: whether it is the recorded one, bit for bit; a restored one only where all of its states are stored
            exactly.
        steps: that it has now.
        clipped: actions that could not ask for the recorded drive targets.
        kept: whether it is in the training file.
        fault: what ended it, where that was not the episode's end: a text; else empty.
    """

    source: int
    success: bool
    exact: bool
    steps: int
    clipped: int
    kept: bool = False
    fault: str = ""


@dataclass(frozen=True)
class OutcomeCounts:
    """What came of many trajectories.

    Attributes:
        replayed: how many there were.
        solved: of them.
        exact: likewise.
        steps: of all.
        clipped: of these steps.
    """

    replayed: int
    solved: int
    exact: int
    steps: int
    clipped: int

    @classmethod
    def of(cls, outcomes: Sequence[Outcome]) -> "OutcomeCounts":
        """The sums."""
        return cls(
            replayed=len(outcomes),
            solved=sum(one.success for one in outcomes),
            exact=sum(one.exact for one in outcomes),
            steps=sum(one.steps for one in outcomes),
            clipped=sum(one.clipped for one in outcomes),
        )


def simulate(
    number: int,
    trajectory: Trajectory,
    env: ManipulationEnv,
    obj: ArticulatedObject,
    source: Control,
    writer: TrajectoryWriter,
) -> Outcome:
    """Play the actions from the level on; `env` may have another control mode than they have."""
    is_same = source.mode == env.control.mode
    player = Replay(trajectory.actions) if is_same else Retarget(trajectory, source)
    observation, info = env.reset(options={"level": trajectory.level, "object": obj, "target": trajectory.target})
    player.begin(env)
    writer.observe(observation)
    disturbed, done, fault = trajectory.disturbed, False, ""
    is_exact = is_same and _digest(env) == trajectory.recording.digests[0]
    try:
        while not done and (action := player.act(env)) is not None:
            observation, reward, terminated, truncated, info = env.step(action)
            done, step = terminated or truncated, len(writer)
            is_disturbed = step < len(disturbed) and disturbed[step]  # a retargeted one may take longer
            writer.step(action, is_disturbed, reward, info["success"])
            writer.observe(observation)
            is_exact = is_exact and _is_as_recorded(env, trajectory, step, reward, info["flags"])
    except DivergedError as error:
        fault = str(error)
    steps = len(writer)
    return Outcome(
        source=number,
        success=bool(info["success"]),  # which ends an episode: one that diverges has not come to it
        exact=is_exact and steps == len(trajectory),
        steps=steps,
        clipped=0 if isinstance(player, Replay) else player.clipped,
        fault=fault,
    )


def _is_as_recorded(
    env: ManipulationEnv, trajectory: Trajectory, step: int, reward: float, flags: Mapping[str, bool]
) -> bool:
    """Whether a step led to the recorded reward and flags, and to the recorded state if that is looked at."""
    if step >= len(trajectory):
        return False
    recording = trajectory.recording
    is_due = step % _DIGEST_STEPS == 0 or step == len(trajectory) - 1
    return (
        reward == recording.rewards[step]
        and list(flags.values()) == recording.flags[step].tolist()
        and (not is_due or _digest(env) == recording.digests[step + 1])
    )


def _digest(env: ManipulationEnv) -> int:
    """Of its present state."""
    return digest_of(env.save_state().simulation)


def restore(
    number: int,
    trajectory: Trajectory,
    env: ManipulationEnv,
    obj: ArticulatedObject,
    source: Control,
    writer: TrajectoryWriter,
) -> Outcome:
    """Put every recorded state in place; rewards and successes are the recorded ones.

    States are exact where the file has them so, else rounded as it has them. Nothing is simulated, so that this
    works with demonstrations of another version of the engine, too.
    """
    scene = cached_scene(env.task.robot, obj, env.task.physics, env.task.props)
    exact = set(trajectory.exact_steps.tolist())
    recording, states = trajectory.recording, trajectory.states
    solved = [bool(row.all()) for row in recording.flags]
    clipped, steps = 0, len(trajectory)
    state = trajectory.env_state(0)
    observation, _ = env.restore_state(state)
    writer.observe(observation)
    for step, recorded in enumerate(trajectory.actions, start=1):
        action, is_met = converted_at(recorded, source, env)
        clipped += not is_met
        if step in exact:
            state = trajectory.env_state(step)
        else:
            values = {name: value[step] for name, value in states.items()}
            simulation = with_values(state.simulation, scene, values, env.snapshot)
            state = replace(state, simulation=simulation, elapsed=step)
        observation, _ = env.restore_state(state)
        k = step - 1
        writer.step(action, recording.disturbed[k], recording.rewards[k], solved[k])
        writer.observe(observation)
    is_exact = source.mode == env.control.mode and len(exact) == steps + 1
    return Outcome(number, trajectory.success, is_exact, steps, clipped)
