from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from artiskill.demos.demo_file import DemoFile, Trajectory
from artiskill.demos.recording import simulation_arrays
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.state import EnvState
from artiskill.errors import DemoError, StateError


@pytest.fixture(scope="module")
def file(drawers: Path) -> DemoFile:
    return DemoFile(drawers / "cabinet-0026.h5")


@pytest.fixture(scope="module")
def trajectory(file: DemoFile) -> Trajectory:
    return file.trajectory(1)


@pytest.fixture(scope="module")
def env(file: DemoFile) -> ManipulationEnv:
    return file.make_env()


@pytest.fixture(scope="module")
def live(file: DemoFile, trajectory: Trajectory) -> list[EnvState]:
    """The states of an environment of its own, which plays the actions from the level on."""
    env = ManipulationEnv("OpenCabinetDrawer", "cabinet-0026")
    _, info = env.reset(options={"level": trajectory.level, "target": trajectory.target})
    states = [env.save_state()]
    for step, action in enumerate(trajectory.actions):
        _, reward, terminated, truncated, info = env.step(action)
        assert reward == trajectory.rewards[step]
        assert list(info["flags"].values()) == trajectory.recording.flags[step].tolist()
        assert (terminated or truncated) == (step == len(trajectory) - 1)
        states.append(env.save_state())
    assert info["success"]
    assert trajectory.success
    assert list(info["flags"]) == list(file.header.flag_names)
    return states


def assert_same(one: EnvState, other: EnvState) -> None:
    for name in ("task", "object", "target", "level", "elapsed"):
        assert getattr(one, name) == getattr(other, name), name
    np.testing.assert_array_equal(one.streaks, other.streaks)
    ours, theirs = simulation_arrays(one.simulation), simulation_arrays(other.simulation)
    assert ours.keys() == theirs.keys()
    for name, value in ours.items():
        assert value.tobytes() == theirs[name].tobytes(), name
    assert one.simulation.object_hash == other.simulation.object_hash
    assert one.simulation.physics == other.simulation.physics


def test_stored_states_need_no_environment(trajectory: Trajectory, live: list[EnvState]) -> None:
    steps = trajectory.exact_steps.tolist()
    assert steps == [*range(0, len(trajectory), 30), len(trajectory)]
    for step in steps:
        assert_same(trajectory.env_state(step), live[step])


def test_any_state_comes_back_exactly(trajectory: Trajectory, live: list[EnvState], env: ManipulationEnv) -> None:
    for step in (1, 29, 31, 59, len(trajectory) - 1):
        assert_same(trajectory.env_state(step, env), live[step])


def test_all_states_in_one_run(trajectory: Trajectory, live: list[EnvState], env: ManipulationEnv) -> None:
    found = []
    for state in trajectory.env_states(env):
        found.append(state)
        env.reset(options={"level": 7})  # somebody else uses it between
    assert len(found) == len(live)
    for one, other in zip(found, live, strict=True):
        assert_same(one, other)


def test_a_restored_state_goes_on_as_before(
    trajectory: Trajectory, live: list[EnvState], env: ManipulationEnv
) -> None:
    env.restore_state(trajectory.env_state(30))
    for action in trajectory.actions[30:]:
        env.step(action)
    assert_same(env.save_state(), live[-1])


def test_rounded_states_are_near_the_exact_ones(trajectory: Trajectory, env: ManipulationEnv) -> None:
    states = trajectory.states
    for step in (0, 17, len(trajectory)):
        env.restore_state(trajectory.env_state(step, env))
        snapshot = env.snapshot
        np.testing.assert_allclose(states["robot_qpos"][step], snapshot.robot_qpos[0], atol=2**-15)
        np.testing.assert_allclose(states["robot_qvel"][step], snapshot.robot_qvel[0], atol=2**-10)
        joints = states["object_qpos"].shape[1]
        np.testing.assert_allclose(states["object_qpos"][step], snapshot.object_qpos[0, :joints], atol=2**-15)
        np.testing.assert_allclose(states["root_position_w"][step], snapshot.link_position_w[0, 0], atol=2**-15)


def test_what_does_not_fit_is_refused(trajectory: Trajectory, env: ManipulationEnv) -> None:
    with pytest.raises(DemoError, match=r"stored of the steps \[0, 30, 60.*an environment is needed"):
        trajectory.env_state(7)
    with pytest.raises(IndexError, match="has the steps 0 to"):
        trajectory.env_state(len(trajectory) + 1)
    other_mode = ManipulationEnv("OpenCabinetDrawer", "cabinet-0026", control_mode="operational_space")
    with pytest.raises(DemoError, match=r"control mode 'joint', the environment 'operational_space'"):
        trajectory.env_state(7, other_mode)
    with pytest.raises(StateError, match="cannot restore"):
        trajectory.env_state(7, ManipulationEnv("OpenCabinetDoor", "cabinet-0006"))
    slower = ManipulationEnv("OpenCabinetDrawer", "cabinet-0026", config={"physics.solver_iterations": 99})
    with pytest.raises(StateError, match="another physics configuration"):
        trajectory.env_state(7, slower)


def test_wrappers_do_not_matter(trajectory: Trajectory, live: list[EnvState], env: ManipulationEnv) -> None:
    wrapped = gym.wrappers.TimeLimit(gym.wrappers.OrderEnforcing(env), 3)
    assert_same(trajectory.env_state(7, wrapped), live[7])
    states = trajectory.env_states(wrapped)
    for step in range(5):
        assert_same(next(states), live[step])


def test_values_of_the_wrong_kind(trajectory: Trajectory, env: ManipulationEnv) -> None:
    for step in (1.5, "a", None):
        with pytest.raises(TypeError, match="a step must be a whole number, not"):
            trajectory.env_state(step, env)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="needs a `ManipulationEnv`, wrapped or not, instead of 'env'"):
        trajectory.env_state(7, "env")  # type: ignore[arg-type]
    assert trajectory.env_state(np.int64(7), env).elapsed == 7  # type: ignore[arg-type]


def test_another_outcome_is_noticed(file: DemoFile, env: ManipulationEnv) -> None:
    trajectory = file.trajectory(0)
    trajectory.actions[3, 0] = 0.01
    trajectory.env_state(3, env)
    with pytest.raises(DemoError, match="the state of step 4 has the digest"):
        trajectory.env_state(4, env)
    trajectory.recording.key_frames[1, 40] += 1e-12
    with pytest.raises(DemoError, match="the state of step 30 has the digest"):
        trajectory.env_state(30)
