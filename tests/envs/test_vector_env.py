"""The vector environment's own matters; that it does what single ones do is in the contract."""

import dataclasses
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from artiskill.assets.catalog import load_object
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.vector_env import ManipulationVectorEnv
from artiskill.errors import ActionError, ConfigError, ResetNeededError, StateError, UnknownNameError

TASK = "OpenCabinetDrawer"


def make(num_envs: int = 3, **kwargs: Any) -> ManipulationVectorEnv:
    return ManipulationVectorEnv(num_envs, **{"task": TASK, "objects": "test"} | kwargs)


def zeros(env: ManipulationVectorEnv) -> np.ndarray:
    return np.zeros(env.action_space.shape, np.float32)


def test_make_vec_gives_ours() -> None:
    env = gym.make_vec("ArtiSkill/PushChair-v0", num_envs=2, objects="train", num_threads=1)
    assert isinstance(env.unwrapped, ManipulationVectorEnv)
    assert env.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    assert env.reset(seed=0)[0].shape == env.observation_space.shape
    fixed = gym.make_vec("ArtiSkill/OpenCabinetDrawer_cabinet-0003_link_1-v0", num_envs=2)
    _, info = fixed.reset(seed=0)
    assert list(info["object"]) == ["cabinet-0003"] * 2
    assert list(info["target"]) == ["link_1"] * 2


@pytest.mark.parametrize("mode", ["sync", "async"])
def test_single_environments_work_in_gymnasiums_vectors(mode: str) -> None:
    env = gym.make_vec(f"ArtiSkill/{TASK}-v0", num_envs=2, vectorization_mode=mode, objects="cabinet-0003")
    ours = make(2, objects="cabinet-0003")
    observation, _ = env.reset(seed=4)
    np.testing.assert_array_equal(observation, ours.reset(seed=4)[0])
    np.testing.assert_array_equal(env.step(zeros(ours))[0], ours.step(zeros(ours))[0])
    env.close()


def test_observations_are_the_callers_unless_asked_otherwise() -> None:
    env, lean = make(), make(copy=False)
    for one in (env, lean):
        one.reset(seed=0)
    first, _, *_ = env.step(zeros(env))
    kept = first.copy()
    lean_first, *_ = lean.step(zeros(lean))
    np.testing.assert_array_equal(first, lean_first)
    actions = np.ones(env.action_space.shape, np.float32)
    second, *_ = env.step(actions)
    lean_second, *_ = lean.step(actions)
    np.testing.assert_array_equal(first, kept)
    assert lean_second is lean_first, "the same arrays are written into"
    np.testing.assert_array_equal(second, lean_second)


def test_what_callers_write_into_their_observations_does_not_come_back() -> None:
    env, twin = make(), make()
    for one in (env, twin):
        observation, _ = one.reset(seed=0)
        if one is env:
            observation *= 0
    mask = {"reset_mask": np.array([True, False, False]), "level": 9}
    np.testing.assert_array_equal(env.reset(options=mask)[0], twin.reset(options=mask)[0])


def test_a_reset_of_some_shows_the_others_as_they_are_now() -> None:
    """Restored meanwhile, or seen with other eyes, in reused arrays too."""
    for copy in (True, False):
        env = make(copy=copy)
        env.reset(seed=0)
        early = env.save_state(1)
        before = env.step(np.ones(env.action_space.shape, np.float32))[0].copy()
        env.restore_state(1, early)
        mask = {"reset_mask": np.array([True, False, False]), "level": 9}
        after, _ = env.reset(options=mask)
        np.testing.assert_array_equal(after[2], before[2])
        np.testing.assert_array_equal(after[1], make().reset(seed=0)[0][1])


def test_a_closed_one_says_so() -> None:
    env = make(2, obs_mode="rgbd", config={"cameras.width": 64, "cameras.height": 48}, num_threads=2)
    env.reset(seed=0)
    env.close()
    for act in (lambda: env.step(zeros(env)), lambda: env.reset(seed=0)):
        with pytest.raises(ConfigError, match="closed"):
            act()


def test_seeds_and_levels_as_arrays_without_dimension() -> None:
    env = make()
    np.testing.assert_array_equal(env.reset(seed=np.array(5))[1]["level"], [5, 6, 7])
    np.testing.assert_array_equal(env.reset(options={"level": np.array(3)})[1]["level"], [3, 3, 3])
    single = ManipulationEnv(TASK, objects="test")
    assert single.reset(seed=5, options={"level": None})[1]["level"] == 5


@pytest.mark.parametrize("given", ["SameStep", "same_step", AutoresetMode.SAME_STEP])
def test_modes_by_gymnasiums_value_too(given: AutoresetMode | str) -> None:
    assert make(1, autoreset_mode=given).metadata["autoreset_mode"] is AutoresetMode.SAME_STEP


@pytest.mark.parametrize("number", [-1, 3, True, "0"])
def test_states_of_environments_that_are_not_there(number: object) -> None:
    env = make()
    env.reset(seed=0)
    state = env.save_state(0)
    for act in (lambda: env.save_state(number), lambda: env.restore_state(number, state)):
        with pytest.raises(ConfigError, match="numbered 0 to 2"):
            act()


def test_objects_per_environment() -> None:
    env = make(2, env_objects=["cabinet-0003", ["cabinet-0005"]])
    for seed in (0, 7):
        _, info = env.reset(seed=seed)
        assert list(info["object"]) == ["cabinet-0003", "cabinet-0005"]
    with pytest.raises(ConfigError, match=r"env_objects.*list of 2"):
        make(2, env_objects=["cabinet-0003"])


def test_options_for_all_or_for_each() -> None:
    env = make(2)
    _, info = env.reset(options={"object": "cabinet-0003", "level": [4, 9], "target": ["link_0", "link_2"]})
    assert list(info["object"]) == ["cabinet-0003"] * 2
    assert info["level"].tolist() == [4, 9]
    assert list(info["target"]) == ["link_0", "link_2"]
    assert env.get_attr("level") == (4, 9)
    assert env.get_attr("task")[1].name == TASK


def test_seeds_may_be_a_list() -> None:
    env = make(3)
    _, info = env.reset(seed=[5, None, 5])
    assert info["level"][0] == info["level"][2] == 5
    single = ManipulationEnv(TASK, objects="test")
    single.reset(seed=5)
    following = single.reset()[1]["level"]
    env.reset(seed=[5, None, 5])
    assert env.reset()[1]["level"][[0, 2]].tolist() == [following, following], "seeded alike, they draw alike"


def test_a_partial_reset_leaves_the_others() -> None:
    env = make(3)
    before, _ = env.reset(seed=0)
    env.step(zeros(env))
    now, *_ = env.step(zeros(env))
    after, info = env.reset(seed=0, options={"reset_mask": np.array([False, True, False])})
    np.testing.assert_array_equal(after[[0, 2]], now[[0, 2]])
    np.testing.assert_array_equal(after[1], before[1])
    assert info["_object"].tolist() == [False, True, False]


def test_an_object_with_a_layout_of_its_own_joins_and_leaves(cabinet_without_layout: Any) -> None:
    strange = cabinet_without_layout
    env, single = make(3, objects=[strange, "cabinet-0003"]), ManipulationEnv(TASK, objects=[strange])
    for chosen in (["cabinet-0003", strange, strange], ["cabinet-0003"] * 3, [strange] * 3):
        observation, info = env.reset(seed=2, options={"object": chosen})
        assert list(info["object"]) == [c if isinstance(c, str) else c.id for c in chosen]
    for k in range(3):
        np.testing.assert_array_equal(observation[k], single.reset(options={"level": 2 + k})[0])
    stepped, *_ = env.step(zeros(env))
    for k in range(3):
        single.reset(options={"level": 2 + k})
        np.testing.assert_array_equal(stepped[k], single.step(zeros(env)[0])[0])
    assert len(env._episodes.group.batches) == 1


@pytest.fixture
def cabinet_without_layout(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A cabinet that is not padded: as an imported one with more shapes than any layout has room for."""
    from artiskill.scene import scene

    strange = dataclasses.replace(load_object("cabinet-0005"), id="strange")
    plan = scene.plan_padding
    monkeypatch.setattr(scene, "plan_padding", lambda obj, *rest: None if obj is strange else plan(obj, *rest))
    return strange


def test_render_is_a_picture_of_each() -> None:
    env = make(2, render_mode="rgb_array")
    env.reset(seed=0)
    first, second = env.render()
    assert first.shape == (480, 640, 3)
    assert not np.array_equal(first, second)
    single = ManipulationEnv(TASK, objects="test", render_mode="rgb_array")
    single.reset(seed=1)
    np.testing.assert_array_equal(second, single.render())
    with pytest.raises(ConfigError, match="render mode"):
        make(1).render()


def test_call_and_get_attr() -> None:
    env = make(2)
    env.reset(seed=0)
    states = env.call("save_state")
    assert [state.level for state in states] == [0, 1]
    assert env.call("num_threads") == (env.num_threads,) * 2
    with pytest.raises(ConfigError, match="no method of one environment"):
        env.call("step", zeros(env))
    with pytest.raises(AttributeError):
        env.get_attr("nonsense")


def test_illegal_input_is_refused_and_changes_nothing() -> None:
    env = make(2)
    with pytest.raises(ResetNeededError):
        env.step(zeros(env))
    with pytest.raises(ResetNeededError, match="first reset"):
        env.reset(options={"reset_mask": np.array([True, False])})
    before, _ = env.reset(seed=0)
    for options, error, says in (
        ({"levl": 3}, UnknownNameError, "level"),
        ({"level": [1, 2, 3]}, ConfigError, "list of 2"),
        ({"level": -1}, ConfigError, "level"),
        ({"object": "cabinet-9999"}, UnknownNameError, "cabinet-9999"),
        ({"reset_mask": [True, False]}, ConfigError, "booleans"),
        ({"reset_mask": np.zeros(2, bool)}, ConfigError, "at least one"),
    ):
        with pytest.raises(error, match=says):
            env.reset(options=options)
    for actions, says in (
        (np.zeros((3, 13)), r"\(2, 13\)"),
        (np.full((2, 13), np.nan), r"environments \[0, 1\]"),
        ("left", "shape"),
    ):
        with pytest.raises(ActionError, match=says):
            env.step(actions)
    other = make(2)
    other.reset(seed=0)
    np.testing.assert_array_equal(env.step(zeros(env))[0], other.step(zeros(env))[0])
    assert not np.array_equal(before, env.step(zeros(env))[0])


@pytest.mark.parametrize(
    ("kwargs", "error", "says"),
    [
        ({"num_envs": 0}, ConfigError, "num_envs"),
        ({"num_envs": 2, "num_threads": 0}, ConfigError, "num_threads"),
        ({"autoreset_mode": "nextstep"}, UnknownNameError, "next_step"),
        ({"obs_mode": "pixels"}, UnknownNameError, "observation mode"),
        ({"objects": "cabinet-9999"}, UnknownNameError, "cabinet-9999"),
    ],
)
def test_illegal_arguments(kwargs: dict[str, Any], error: type[Exception], says: str) -> None:
    with pytest.raises(error, match=says):
        ManipulationVectorEnv(**{"task": TASK} | kwargs)


def test_a_foreign_state_is_refused() -> None:
    env = make(2)
    env.reset(seed=0)
    other = ManipulationVectorEnv(1, task="OpenCabinetDoor", objects="test")
    other.reset(seed=0)
    with pytest.raises(StateError, match="OpenCabinetDoor"):
        env.restore_state(0, other.save_state(0))


def test_without_automatic_resets_an_ended_episode_must_be_reset() -> None:
    env = make(2, autoreset_mode="disabled", config={"episode_steps": 1})
    env.reset(seed=0)
    *_, truncated, _ = env.step(zeros(env))
    assert truncated.all()
    with pytest.raises(ResetNeededError, match=r"\[0, 1\]"):
        env.step(zeros(env))
    env.reset(options={"reset_mask": np.array([True, True])})
    env.step(zeros(env))


def test_success_ends_an_episode_unless_told_otherwise() -> None:
    """Here every state counts as solved."""
    success = {"near_m": 9.0, "max_tilt_rad": 3.0, "max_speed_m_s": 99.0, "max_angular_speed_rad_s": 99.0}
    easy = {"success": {**success, "hold_s": 0.0}, "episode_steps": 2}
    for ends in (True, False):
        given: Any = {"objects": "train", "config": easy, "terminate_on_success": ends}
        env = ManipulationVectorEnv(2, "PushChair", **given)
        for one in (env, ManipulationEnv("PushChair", **given), pickle.loads(pickle.dumps(env))):
            one.reset(seed=0)
            action = np.zeros(one.action_space.shape, np.float32)
            for step in (1, 2):
                _, _, terminated, truncated, info = one.step(action)
                assert np.all(info["success"])
                assert np.all(terminated) == ends
                assert np.all(truncated) == (not ends and step == 2)
                if ends:
                    break
    with pytest.raises(ConfigError, match="terminate_on_success"):
        ManipulationEnv(terminate_on_success="no")  # type: ignore[arg-type]
