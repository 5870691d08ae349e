"""The Gymnasium face: what may be asked of it, and what it answers to mistakes."""

import dataclasses
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import artiskill
from artiskill.assets.catalog import load_object
from artiskill.assets.needs import TASK_NEEDS, Needs
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.sampling import EpisodeSampler
from artiskill.envs.state import EnvState
from artiskill.errors import (
    ActionError,
    ArtiSkillError,
    AssetError,
    ConfigError,
    ResetNeededError,
    UnknownNameError,
)

DRAWERS, DOORS_ONLY = "cabinet-0003", "cabinet-0006"


@pytest.fixture
def env() -> ManipulationEnv:
    return ManipulationEnv(objects=DRAWERS)


def test_every_cabinet_and_every_drawer_has_an_id() -> None:
    ids = {name for name in gym.registry if name.startswith("ArtiSkill/")}
    assert {"ArtiSkill/OpenCabinetDrawer-v0", "ArtiSkill/OpenCabinetDrawer_cabinet-0003_link_3-v0"} <= ids
    for task, targets in (("OpenCabinetDrawer", 70), ("OpenCabinetDoor", 82)):  # the benchmark's numbers
        benchmark = tuple(f"ArtiSkill/{task}_{name}_link_" for name in artiskill.list_objects(task=task))
        assert len([name for name in ids if name.startswith(benchmark)]) == targets
    assert {f"ArtiSkill/PushChair_{name}-v0" for name in artiskill.list_objects("chair", "ood")} <= ids


def test_objects_may_be_a_split_an_id_a_list_or_an_object() -> None:
    test_ids = artiskill.list_objects(split="test", task="OpenCabinetDrawer")
    drawn = {ManipulationEnv(objects="test").reset(seed=level)[1]["object"] for level in range(30)}
    assert drawn <= set(test_ids)
    assert len(drawn) > 5, "a random object per level"
    assert ManipulationEnv(objects=DRAWERS).reset(seed=0)[1]["object"] == DRAWERS
    both = ManipulationEnv(objects=[DRAWERS, load_object("generated:8")])
    assert {both.reset(seed=level)[1]["object"] for level in range(12)} == {DRAWERS, "generated-cabinet-8"}
    assert ManipulationEnv(objects=load_object(DRAWERS)).reset(seed=0)[1]["object"] == DRAWERS


def test_reset_without_a_seed_draws_the_next_level(env: ManipulationEnv) -> None:
    levels = [env.reset(seed=5)[1]["level"], env.reset()[1]["level"], env.reset()[1]["level"]]
    assert levels[0] == 5
    assert len(set(levels)) == 3
    again = [env.reset(seed=5)[1]["level"], env.reset()[1]["level"], env.reset()[1]["level"]]
    assert again == levels, "the levels after a seed follow from it"


def test_options_are_explicit(env: ManipulationEnv) -> None:
    _, info = env.reset(options={"level": 8, "object": "cabinet-0005", "target": "link_1"})
    assert (info["level"], info["object"], info["target"]) == (8, "cabinet-0005", "link_1")


def test_truncated_after_the_limit_and_never_both(env: ManipulationEnv) -> None:
    env = ManipulationEnv(objects=DRAWERS, config={"episode_steps": 7}, reward_mode="sparse")
    env.reset(seed=0)
    ends = [env.step(np.zeros(13, np.float32))[1:4] for _ in range(7)]
    assert ends == [(0.0, False, False)] * 6 + [(0.0, False, True)]


def test_actions_out_of_range_are_clipped(env: ManipulationEnv) -> None:
    env.reset(seed=0)
    env.step(np.full(13, 5.0))
    far = env.save_state()
    env.reset(seed=0)
    env.step(np.ones(13))
    np.testing.assert_array_equal(far.simulation.rows, env.save_state().simulation.rows)


@pytest.mark.parametrize(
    ("action", "says"),
    [
        (np.zeros(12), r"shape \(13,\), not \(12,\)"),
        (np.zeros((1, 13)), r"shape \(13,\), not \(1, 13\)"),
        (np.full(13, np.nan), "finite"),
        ([0.0] * 12 + [np.inf], r"entries \[12\]"),
        ("left", "13 real numbers"),
        (np.zeros(13) + 1j, "not complex"),
        (None, "finite|shape"),
    ],
)
def test_illegal_actions(env: ManipulationEnv, action: object, says: str) -> None:
    env.reset(seed=0)
    before = env.save_state().simulation.rows
    with pytest.raises(ActionError, match=says):
        env.step(action)
    np.testing.assert_array_equal(env.save_state().simulation.rows, before)


@pytest.mark.parametrize(
    ("kwargs", "error", "says"),
    [
        ({"task": "OpenCabinetDrawr"}, UnknownNameError, "OpenCabinetDrawer"),
        ({"objects": "tset"}, UnknownNameError, "test|cabinet"),
        ({"objects": "cabinet-014"}, UnknownNameError, "cabinet-0"),
        ({"objects": []}, AssetError, "at least one"),
        ({"objects": DOORS_ONLY}, AssetError, "no drawer"),
        ({"obs_mode": "states"}, UnknownNameError, "'state'"),
        ({"reward_mode": "dens"}, UnknownNameError, "'dense'"),
        ({"render_mode": "humam"}, UnknownNameError, "did you mean 'human'"),
        ({"objects": DRAWERS, "target": "link_9"}, UnknownNameError, "link_3"),
        ({"config": {"episode_step": 3}}, ConfigError, "episode_steps"),
        ({"config": {"physics.timestep_s": 0.5}}, ConfigError, "timestep_s"),
        ({"config": {"physics.timestep": 0.001}}, ConfigError, "timestep_s"),
        ({"config": {"reward.weights.hand_angel": 1}}, ConfigError, "hand_angle"),
        ({"config": {"robot": "two_arm"}}, UnknownNameError, "one_arm"),
        ({"config": {"motion": "revolute"}}, ConfigError, "cannot be changed"),
        ({"config": {"name": "Foo"}}, ConfigError, "cannot be changed"),
        ({"config": [1]}, ConfigError, "mapping"),
        (
            {"config": {"initial.heading_noise_rad": -1}},
            ConfigError,
            "heading_noise_rad must be finite and at least 0, not -1",
        ),
        ({"config": {"initial.robot_circle_radius_m": [1, float("inf")]}}, ConfigError, "range"),
        (
            {"config": {"initial.robot_circle_center_m": [float("nan"), 0]}},
            ConfigError,
            "a number was expected, not nan",
        ),
        ({"config": {"initial.lift_m": 9}}, ConfigError, "lift_m"),
        ({"config": {"initial.joint_damping": [-2, 5]}}, ConfigError, "at least 0"),
        ({"config": {"success.hold_s": float("inf")}}, ConfigError, "finite"),
        ({"config": {"success.max_speed_m_s": -1}}, ConfigError, "positive"),
        ({"config": {"physics.contact.impratio": -1}}, ConfigError, "impratio"),
        ({"config": {"physics.contact.impedance": [2, 3, 0, 0, 0]}}, ConfigError, "d_min"),
        ({"config": {"physics.gravity_m_s2": float("nan")}}, ConfigError, "gravity"),
        ({"config": {"reward.weights.opening": float("nan")}}, ConfigError, "a number was expected, not nan"),
    ],
)
def test_illegal_constructions(kwargs: dict, error: type[ArtiSkillError], says: str) -> None:
    with pytest.raises(error, match=says):
        ManipulationEnv(**kwargs)


@pytest.mark.parametrize(
    ("options", "error", "says"),
    [
        ({"levle": 3}, UnknownNameError, "level"),
        ({"level": -1}, ConfigError, "from 0"),
        ({"level": 1.5}, ConfigError, "integer"),
        ({"object": "cabinet-9999"}, UnknownNameError, "cabinet-"),
        ({"target": "base"}, UnknownNameError, "link_"),
        (3, ConfigError, "a mapping with the keys level, object, target, not 3"),
        (["level"], ConfigError, r"not \['level'\]"),
        (0, ConfigError, "not 0"),
    ],
)
def test_illegal_reset_options(env: ManipulationEnv, options: Any, error: type[ArtiSkillError], says: str) -> None:
    with pytest.raises(error, match=says):
        env.reset(options=options)


def test_nothing_works_before_the_first_reset(env: ManipulationEnv) -> None:
    for use in (lambda: env.step(np.zeros(13)), env.save_state, lambda: env.snapshot, lambda: env.goal):
        with pytest.raises(ResetNeededError, match="reset"):
            use()


def test_a_failed_reset_leaves_the_episode_as_it_was(env: ManipulationEnv) -> None:
    observation, info = env.reset(seed=2)
    with pytest.raises(UnknownNameError):
        env.reset(options={"object": "cabinet-9999"})
    state = env.save_state()
    assert (state.level, state.object) == (2, info["object"])
    restored, _ = env.restore_state(state)
    np.testing.assert_array_equal(restored, observation)


def damaged(state: EnvState, **changes: object) -> EnvState:
    return dataclasses.replace(state, **changes)


def test_refused_states_change_nothing(env: ManipulationEnv) -> None:
    other = ManipulationEnv(objects="cabinet-0005")
    other.reset(seed=1)
    foreign = other.save_state()
    env.reset(seed=0)
    mine = env.save_state()
    physics = ManipulationEnv(objects=DRAWERS, config={"physics.timestep_s": 0.001})
    physics.reset(seed=0)
    cases = [
        (np.zeros(3), "ndarray"),
        (damaged(mine, task="PushChair"), "PushChair"),
        (damaged(mine, simulation=foreign.simulation), "another object"),
        (damaged(foreign, simulation=mine.simulation), "another object"),
        (physics.save_state(), "physics configuration"),
        (damaged(mine, elapsed=-1), "elapsed -1"),
        (damaged(mine, simulation=None), "simulation is damaged: it is a NoneType"),
        (damaged(mine, streaks=np.zeros(3, int)), "streaks"),
        (damaged(mine, target="link_77"), "link_"),
        (damaged(mine, object="cabinet-9999"), "cabinet-"),
    ]
    for state, says in cases:
        with pytest.raises(ArtiSkillError, match=says):
            env.restore_state(state)  # type: ignore[arg-type]
        after = env.save_state()
        assert (after.object, after.target, after.level) == (mine.object, mine.target, mine.level)
        np.testing.assert_array_equal(after.simulation.rows, mine.simulation.rows)
    env.step(np.zeros(13))


def test_states_of_objects_that_were_handed_in_come_back(env: ManipulationEnv) -> None:
    mine = dataclasses.replace(load_object("generated:8"), id="mine")
    observation, _ = env.reset(seed=3, options={"object": mine})
    state = pickle.loads(pickle.dumps(env.save_state()))
    env.reset(seed=4)
    restored, info = env.restore_state(state)
    assert info["object"] == "mine"
    np.testing.assert_array_equal(restored, observation)


def test_rendering_needs_an_episode() -> None:
    with pytest.raises(ResetNeededError, match="before render"):
        ManipulationEnv(objects=DRAWERS, render_mode="rgb_array").render()


def test_an_object_without_target_is_refused(env: ManipulationEnv, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the task says are its targets: nothing is drawn from none."""
    task = dataclasses.replace(env.task, targets=lambda obj: ())
    says = "'cabinet-0005' has no link that OpenCabinetDrawer could be done with"
    with pytest.raises(AssetError, match=f"{says}$"):
        EpisodeSampler(task, "cabinet-0005").draw(0)
    monkeypatch.setitem(TASK_NEEDS, "OpenCabinetDrawer", Needs("OpenCabinetDrawer", "cabinet", None))
    with pytest.raises(AssetError, match=f"{says}; register the task with motion=, and splits leave such"):
        EpisodeSampler(task, "cabinet-0005").draw(0)


def test_rendering_needs_a_mode(env: ManipulationEnv) -> None:
    env.reset(seed=0)
    with pytest.raises(ConfigError, match="rgb_array"):
        env.render()


def test_pictures_show_the_scene() -> None:
    env = ManipulationEnv(objects=DRAWERS, render_mode="rgb_array")
    env.reset(seed=0)
    first = env.render()
    assert (first.shape, first.dtype) == ((480, 640, 3), np.uint8)
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 1000, "more than a plain background"
    env.reset(options={"level": 0, "object": "cabinet-0005"})
    assert (env.render() != first).any(axis=-1).mean() > 0.02, "another cabinet looks different"


def test_the_docstring_tells_the_spaces(env: ManipulationEnv) -> None:
    text = ManipulationEnv.__doc__ or ""
    rows = [row for row in text.splitlines() if row.strip().startswith("| ") and "---" not in row][1:]
    numbers = [row.split("|")[1].strip() for row in rows]
    covered = []
    for entry in numbers:
        first, _, last = entry.partition("-")
        covered += range(int(first), int(last or first) + 1)
    assert covered == list(range(env.action_space.shape[0]))
    scale = env.control.joint_scale
    for row in rows:
        first = int(row.split("|")[1].strip().partition("-")[0])
        low, high = row.split("|")[3].strip().split(" ")[0], row.split("|")[3].strip().split(" ")[2]
        np.testing.assert_allclose(scale.to_targets(-np.ones(13))[first], float(low), atol=1e-12)
        np.testing.assert_allclose(scale.to_targets(np.ones(13))[first], float(high), atol=1e-12)
