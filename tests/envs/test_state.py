"""States of other environments, and damaged ones: refused by both faces, before anything has changed."""

import pickle
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.state import EnvState
from artiskill.envs.vector_env import ManipulationVectorEnv
from artiskill.errors import ArtiSkillError, StateError

TASKS = {"OpenCabinetDrawer": "cabinet-0005", "PushChair": "chair-0002", "MoveBucket": "bucket-0002"}
_TIME, _QPOS = 0, 1


class Single:
    """A single environment, seen as the vector is below."""

    def __init__(self, task: str, **options: Any) -> None:
        self.env = ManipulationEnv(task, TASKS[task], **options)
        self.env.reset(seed=1)
        self.step()

    def step(self) -> None:
        assert self.env.action_space.shape is not None
        self.env.step(np.full(self.env.action_space.shape, 0.1, np.float32))

    def save(self) -> list[EnvState]:
        return [self.env.save_state()]

    def restore(self, state: EnvState) -> None:
        self.env.restore_state(state)


class Vector(Single):
    """A vector of two, of which the second takes states."""

    def __init__(self, task: str, **options: Any) -> None:
        self.env = ManipulationVectorEnv(2, task, TASKS[task], num_threads=1, **options)
        self.env.reset(seed=1)
        self.step()

    def save(self) -> list[EnvState]:
        return list(self.env.call("save_state"))

    def restore(self, state: EnvState) -> None:
        self.env.restore_state(1, state)


FACES = pytest.mark.parametrize("face", [Single, Vector])


def bits(face: Single) -> list[bytes]:
    """All that states of its environments hold, and what their models, progress and snapshots are beside that."""
    found = [pickle.dumps(state) for state in face.save()]
    episodes = face.env._episodes
    for batch in episodes.group.batches:
        found.append(batch.snapshot.body_position_w.tobytes())
        for model in batch.simulation._models:
            found += [model.dof_frictionloss.tobytes(), model.dof_damping.tobytes(), model.jnt_range.tobytes()]
    return [*found, episodes.elapsed.tobytes(), episodes.streaks.tobytes()]


def refuse(face: Single, state: Any, says: str) -> None:
    """Restoring fails, nothing has changed, and the environment goes on."""
    before = bits(face)
    with pytest.raises(ArtiSkillError, match=says):
        face.restore(state)
    assert bits(face) == before
    face.step()


OTHERS = [
    (
        "OpenCabinetDrawer",
        {"robot.drives.arm_damping": 90},
        r"another robot .*: drives\.arm_damping 90\.0 there, 100\.0 here",
    ),
    ("OpenCabinetDrawer", {"robot.torso.body.mass_kg": 9}, r"another robot .*: torso\.body\.mass_kg 9\.0 there, "),
    (
        "OpenCabinetDrawer",
        {"physics.timestep_s": 0.001},
        r"another physics .*: timestep_s 0\.001 there, 0\.002 here",
    ),
    (
        "OpenCabinetDrawer",
        {"physics.contact.ground_friction": 2},
        r"contact\.ground_friction 2\.0 there, 1\.0 here",
    ),
    ("MoveBucket", {"props.ball_radius_m": 0.02}, r"another props .*: ball\.size \[0\.02\] there, "),
    ("MoveBucket", {"props.ball_density_kg_m3": 700}, r"another props .*: ball\.density_kg_m3 700\.0 there, "),
    ("MoveBucket", {"props.platform_height_m": 0.2}, r"another props .*: platform\."),
]


@FACES
@pytest.mark.parametrize(("task", "config", "says"), OTHERS)
def test_states_of_other_worlds_are_refused(
    face: Callable[..., Single], task: str, config: dict[str, float], says: str
) -> None:
    refuse(face(task), Single(task, config=config).save()[0], says)


@FACES
def test_what_is_only_drawn_or_asked_for_may_differ(face: Callable[..., Single]) -> None:
    """The size of PushChair's target is what counts as near, and no part of the physics."""
    state = Single("PushChair", config={"success.near_m": 0.3, "episode_steps": 50}).save()[0]
    env = face("PushChair")
    env.restore(state)
    assert np.array_equal(env.save()[-1].simulation.rows, state.simulation.rows)


@FACES
def test_what_levels_draw_is_restored(face: Callable[..., Single]) -> None:
    """Friction, damping and limits of the object's joints, whatever the ranges of the environment."""
    config = {"initial.joint_friction": [9.0, 9.5], "initial.joint_damping": [31.0, 32.0]}
    state = pickle.loads(pickle.dumps(Single("OpenCabinetDrawer", config=config).save()[0]))
    env = face("OpenCabinetDrawer")
    env.restore(state)
    mine = env.save()[-1].simulation
    assert (mine.joint_friction[0, :2] >= 9).all()
    assert np.array_equal(mine.joint_damping, state.simulation.joint_damping)


def changed(name: str, *index: Any, value: Any) -> Callable[[EnvState], EnvState]:
    """With other numbers in an array of the simulation."""

    def change(state: EnvState) -> EnvState:
        array = getattr(state.simulation, name).copy()
        array[index] = value
        return replaced(**{name: array})(state)

    return change


def replaced(**values: Any) -> Callable[[EnvState], EnvState]:
    """With something else for a part of the simulation; functions are called with what is there."""

    def change(state: EnvState) -> EnvState:
        simulation = state.simulation
        new = {k: v(getattr(simulation, k)) if callable(v) else v for k, v in values.items()}
        return replace(state, simulation=replace(simulation, **new))

    return change


def swap(limits: np.ndarray) -> np.ndarray:
    return limits[..., ::-1].copy()


def as_objects(rows: np.ndarray) -> np.ndarray:
    return rows.astype(object)


def as_texts(rows: np.ndarray) -> np.ndarray:
    return rows.astype(str)


DAMAGES: list[tuple[Callable[[EnvState], Any], str]] = [
    (replaced(rows=as_objects), "rows of float64, not of object"),
    (replaced(rows=as_texts), "rows of float64, not of <U"),
    (replaced(rows=lambda rows: rows.tolist()), "has rows of .*, not list"),
    (replaced(rows=lambda rows: rows.astype(np.complex128)), "not of complex128"),
    (replaced(joint_friction=as_objects), "joint_friction of float64"),
    (changed("rows", 0, 5, value=np.nan), "rows has numbers that are not finite"),
    (changed("rows", 0, 5, value=1e11), "where physics runs away"),
    (changed("rows", 0, _TIME, value=-1.0), "time must not be negative"),
    (changed("joint_friction", 0, 0, value=-1.0), "joint_friction must not be negative; it has -1"),
    (changed("joint_damping", 0, 0, value=-0.5), "joint_damping must not be negative"),
    (changed("joint_friction", 0, -1, value=3.0), "joint_friction has numbers where .* has no joint"),
    (changed("joint_limits", 0, -1, value=3.0), "joint_limits has numbers where .* has no joint"),
    (replaced(joint_limits=swap), "joint_limits must be a lower and a higher number"),
    (changed("previous_link_quaternion_w", 0, 0, value=0.0), "previous_link_quaternion_w must have unit"),
    (replaced(object_hash=np.zeros(3)), "another object"),
    (replaced(physics=None), "does not say which physics configuration"),
    (replaced(robot=np.zeros(2)), "does not say which robot"),
    (replaced(props=None), "does not say which props"),
    (lambda state: replace(state, elapsed=10**30), "elapsed 10+,"),
    (lambda state: replace(state, elapsed=10**5000), "elapsed a int"),
    (lambda state: replace(state, elapsed=True), "elapsed True"),
    (lambda state: replace(state, elapsed=1.0), "elapsed 1.0"),
    (lambda state: replace(state, streaks=[[1], [1, 2], 3]), "streaks"),
    (lambda state: replace(state, streaks=state.streaks + 2**40), "streaks"),
    (lambda state: replace(state, streaks=state.streaks.astype(object)), "streaks"),
    (lambda state: replace(state, level=10**30), "a level is"),
    (lambda state: replace(state, task=np.zeros(3)), "cannot restore a state of array"),
    (lambda state: replace(state, object=["cabinet-0005"]), "object is damaged"),
    (lambda state: replace(state, object=np.zeros(3)), "object is damaged"),
    (lambda state: replace(state, target=np.zeros(3)), "target is damaged"),
    (lambda state: replace(state, target=None), "target is damaged: a name is text, not None"),
    (lambda state: None, "a state of 'NoneType'"),
]


@FACES
def test_damaged_states_are_refused(face: Callable[..., Single]) -> None:
    env = face("OpenCabinetDrawer")
    for damage, says in DAMAGES:
        refuse(env, damage(env.save()[-1]), says)


@FACES
@pytest.mark.parametrize("free", ["root", "prop"])
def test_a_zero_quaternion_is_refused(face: Callable[..., Single], free: str) -> None:
    env = face("MoveBucket")
    index = Single("MoveBucket").env.scene.index
    place = index.root_qpos if free == "root" else index.prop_qpos
    at = slice(_QPOS + place.start + 3, _QPOS + place.start + 7)
    refuse(env, changed("rows", 0, at, value=0.0)(env.save()[-1]), "rows must have unit quaternions")


def test_states_pickled_before_they_named_robot_and_props(monkeypatch: pytest.MonkeyPatch) -> None:
    env = Single("OpenCabinetDrawer")
    state = env.save()[0]
    for name in ("robot", "props"):
        object.__delattr__(state.simulation, name)
    with pytest.raises(StateError, match="does not say which robot"):
        env.restore(state)


@FACES
def test_wild_but_legal_numbers_are_restored(face: Callable[..., Single]) -> None:
    """What passes the checks must not fail half-way: up to where the engine itself gives up."""
    env = face("MoveBucket")
    state, rng = env.save()[-1], np.random.default_rng(0)
    scene = Single("MoveBucket").env.scene
    free = _QPOS + scene.index.root_qpos.start
    for scale in (1.0, 1e3, 1e9):
        rows = state.simulation.rows.copy()
        rows[0, _QPOS:free] = scale * rng.uniform(-1, 1, free - _QPOS)
        rows[0, free : free + 3] *= scale
        rows[0, _QPOS + scene.model.nq :] = scale * rng.uniform(-1, 1, rows.shape[1] - _QPOS - scene.model.nq)
        env.restore(replace(state, simulation=replace(state.simulation, rows=rows)))
        assert np.array_equal(env.save()[-1].simulation.rows, rows)
    env.restore(state)
    env.step()
