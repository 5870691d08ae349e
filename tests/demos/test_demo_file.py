"""Files of demonstrations: what they say, damage of every kind, their trajectories as states of an environment."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from artiskill.demos.demo_file import DemoFile, Trajectory
from artiskill.demos.file_format import DEMONSTRATIONS
from artiskill.demos.hdf5 import load_h5py
from artiskill.demos.recording import simulation_arrays
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.state import EnvState
from artiskill.errors import DemoError, StateError
from artiskill.tasks.levels import FIRST_DEMONSTRATED

from .conftest import PER_OBJECT, put

ARRAYS = ("actions", "disturbed", "rewards", "flags", "digests", "states", "key_frames")


def changed(path: Path, **attributes: object) -> Path:
    with load_h5py().File(path, "r+") as file:
        file.attrs.update(attributes)
    return path


@pytest.fixture
def path(own_drawers: Path) -> Path:
    return own_drawers / "cabinet-0002.h5"


def test_what_a_file_says(path: Path) -> None:
    with DemoFile(path) as file:
        header = file.header
        assert (header.object, header.facts["category"], header.facts["split"]) == (
            "cabinet-0002",
            "cabinet",
            "train",
        )
        assert header.settings.task == "OpenCabinetDrawer"
        assert header.settings.expert.name == "OpenCabinetExpert"
        assert header.settings.versions["numpy"] == np.__version__
        assert file.load_object().content_hash == header.content_hash
        assert file.attempts["success"].tolist() == [1, 1, 1]
        trajectory = file.trajectory(0)
        steps = len(trajectory)
        assert trajectory.actions.shape == (steps, 13)
        assert trajectory.actions.dtype == np.float32
        assert trajectory.disturbed.shape == (steps,)
        assert trajectory.disturbed.dtype == np.bool_
        assert trajectory.recording.flags.shape == (steps, len(header.flag_names))
        assert trajectory.recording.digests.shape == (steps + 1,)
        assert trajectory.states["robot_qpos"].shape == (steps + 1, 13)
        with pytest.raises(IndexError, match="has the trajectories 0 to 2, not 3"):
            file.trajectory(3)


def test_a_file_is_a_sequence(path: Path) -> None:
    with DemoFile(path) as file:
        levels = [trajectory.level for trajectory in file]
        assert [file[k].level for k in (0, 1, 2, -3, -2, -1)] == levels * 2
        for k in (3, -4):
            with pytest.raises(IndexError, match="has the trajectories 0 to 2"):
                file[k]
            with pytest.raises(IndexError, match=f"not {k}$"):
                file[k]
        for wrong in ("0", 1.0, None):
            for read in (file.__getitem__, file.trajectory, lambda i: file.array(i, "actions")):
                with pytest.raises(TypeError, match="a trajectory's number must be a whole number, not"):
                    read(wrong)  # type: ignore[arg-type, no-untyped-call]


def test_a_closed_file_is_not_called_damaged(path: Path) -> None:
    with DemoFile(path) as file:
        pass
    for read in (lambda: file[0], lambda: file.array(0, "actions"), lambda: file.attempts):
        with pytest.raises(DemoError, match=r"cabinet-0002\.h5' has been closed: read it before"):
            read()  # type: ignore[no-untyped-call]


def test_an_object_may_be_handed_over_by_name(path: Path) -> None:
    with DemoFile(path) as file:
        env = file.make_env(obj="cabinet-0002")
        env.reset(seed=0)
        assert env.scene.object.id == "cabinet-0002"
        with pytest.raises(DemoError, match="made with another 'cabinet-0002'"):
            file.make_env(obj="cabinet-0026")


def test_an_outcome_that_the_flags_do_not_have(path: Path) -> None:
    with load_h5py().File(path, "r+") as file:
        assert file["traj_1"].attrs["success"]
        file["traj_1"].attrs["success"] = False
    with (
        DemoFile(path) as file,
        pytest.raises(DemoError, match=r"trajectory 1 \(its attribute says success False"),
    ):
        file.trajectory(1)


def test_a_trajectory_in_one_line(path: Path) -> None:
    with DemoFile(path) as file:
        first = file[0]
    said = f"cabinet-0002.h5, trajectory 0: link_0, level {FIRST_DEMONSTRATED}"
    assert repr(first) == f"Trajectory({said}, {len(first)} steps, solved)"


def test_plain_hdf5_readers_find_their_way(path: Path) -> None:
    """The documented layout, without our reader."""
    with load_h5py().File(path, "r") as file:
        assert file.attrs["format"] == "artiskill-demonstrations"
        assert file.attrs["schema_version"] == 2
        group = file["traj_0"]
        assert set(group) == {"actions", "disturbed", "rewards", "flags", "digests", "states", "key_frames"}
        assert set(group.attrs) == {"target", "level", "success"}


def test_truncated(path: Path) -> None:
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(DemoError, match=r"cannot read .*cabinet-0002.h5': it is truncated"):
        DemoFile(path)


def test_no_hdf5(path: Path) -> None:
    path.write_text("hello")
    with pytest.raises(DemoError, match="it is no HDF5 file"):
        DemoFile(path)
    path.unlink()
    with pytest.raises(DemoError, match="there is no file"):
        DemoFile(path)


def test_foreign(path: Path) -> None:
    with load_h5py().File(path, "w") as file:
        file.create_group("traj_0")
    with pytest.raises(DemoError, match="holds no demonstrations of artiskill"):
        DemoFile(path)


def test_another_schema(path: Path) -> None:
    newer = DEMONSTRATIONS.version + 1
    with pytest.raises(DemoError, match=rf"has schema version {newer}; this version of artiskill reads"):
        DemoFile(changed(path, schema_version=newer))


def test_a_damaged_header(path: Path) -> None:
    with pytest.raises(DemoError, match="is damaged: cannot read its header"):
        DemoFile(changed(path, settings="{"))


def test_a_damaged_trajectory(path: Path) -> None:
    with load_h5py().File(path, "r+") as file:
        start = file["traj_1/states"].id.get_chunk_info(0).byte_offset
        del file["traj_2/rewards"]
    data = bytearray(path.read_bytes())
    data[start : start + 64] = bytes(64)
    path.write_bytes(data)
    with DemoFile(path) as file:
        file.trajectory(0)
        with pytest.raises(DemoError, match="is damaged: cannot read states of trajectory 1"):
            file.trajectory(1)
        with pytest.raises(DemoError, match="is damaged: cannot read rewards of trajectory 2"):
            file.trajectory(2)


def test_another_catalogue(path: Path) -> None:
    with (
        DemoFile(changed(path, content_hash="0" * 16)) as file,
        pytest.raises(DemoError, match=r"made with another 'cabinet-0002': its content hash was 0000"),
    ):
        file.make_env()


def test_another_task_of_the_same_configuration(path: Path) -> None:
    with DemoFile(path) as file:
        known = file.header.settings.config_hash
    with load_h5py().File(path, "r+") as raw:
        raw.attrs["settings"] = raw.attrs["settings"].replace(known, "0" * len(known))
    with DemoFile(path) as file, pytest.raises(DemoError, match="makes another OpenCabinetDrawer"):
        file.make_env()


def test_every_success_has_a_trajectory(own_drawers: Path) -> None:
    path = own_drawers / "cabinet-0002.h5"
    with load_h5py().File(path, "r+") as file:
        table = file["attempts"][()]
        table["trajectory"][table["trajectory"] == PER_OBJECT - 1] = -1
        file["attempts"][...] = table
        del file[f"traj_{PER_OBJECT - 1}"]
    with DemoFile(path) as file, pytest.raises(DemoError, match="one that was solved has no trajectory"):
        _ = file.attempts


def wrong(values: np.ndarray) -> np.ndarray:
    values[1] = np.nan
    return values


@pytest.mark.parametrize(
    ("change", "message"),
    [
        *((put(name, lambda values: values[:1]), r"\w+ are \w+ \(.*\), not") for name in ARRAYS),
        *((put(name, lambda values: values.astype(np.int8)), rf"{name} are int8") for name in ARRAYS),
        *(
            (put(name, wrong), f"{name} have numbers that are not finite")
            for name in ("actions", "rewards", "states", "key_frames")
        ),
        (
            put("actions", lambda values: values[:, :-1]),
            r"actions are float32 \(\d+, 12\), not float32 \(\d+, 13\)",
        ),
        (lambda group: group.attrs.__setitem__("level", -5), "a level is an integer from 0 to .*, not .*-5"),
        (lambda group: group.attrs.__setitem__("target", "link_99"), "unknown target 'link_99'; did you mean"),
    ],
)
def test_trajectories_are_checked(own_drawers: Path, change: Callable[[Any], None], message: str) -> None:
    path = own_drawers / "cabinet-0002.h5"
    with load_h5py().File(path, "r+") as file:
        change(file["traj_1"])
    with DemoFile(path) as demos:
        demos.trajectory(0)
        with pytest.raises(DemoError, match=rf"cabinet-0002.h5' is damaged: cannot read trajectory 1 \({message}"):
            demos.trajectory(1)


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
