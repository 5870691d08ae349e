"""What every task promises for every object: spaces, levels, bits, purity, ordered stages, sane physics."""

import hashlib
import subprocess
import sys
import warnings
from dataclasses import fields
from functools import partial

import gymnasium as gym
import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from artiskill.envs.manipulation import OBSERVATION_MODES, ManipulationEnv
from artiskill.experts.open_cabinet import OpenCabinetExpert, Phase
from artiskill.sim.simulation import Simulation
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.levels import Stream, level_generator

TASK = "OpenCabinetDrawer"
VISUAL_MODES = tuple(mode for mode in OBSERVATION_MODES if mode != "state")


def make_env(object_id: str, **kwargs) -> ManipulationEnv:
    return ManipulationEnv(TASK, objects=object_id, **kwargs)


def random_actions(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1, 1, (count, 13)).astype(np.float32)


def rollout(env: ManipulationEnv, level: int, actions: np.ndarray) -> list:
    """Observations, rewards and flags of a level under given actions."""
    observation, info = env.reset(seed=level)
    trace = [(observation, 0.0, info["flags"])]
    for action in actions:
        observation, reward, _, _, info = env.step(action)
        trace.append((observation, reward, info["flags"]))
    return trace


def assert_same(first: list, second: list) -> None:
    assert len(first) == len(second)
    for (o1, r1, f1), (o2, r2, f2) in zip(first, second, strict=True):
        np.testing.assert_array_equal(o1, o2)
        assert r1 == r2
        assert f1 == f2


def digest(env: ManipulationEnv) -> str:
    return hashlib.sha256(env.save_state().simulation.rows.tobytes()).hexdigest()


def grip_handle(env: ManipulationEnv, level: int, steps_into_pull: int = 5) -> None:
    """Bring the environment into contact: the gripper holds the handle and pulls."""
    env.reset(seed=level)
    expert = OpenCabinetExpert(env.task.robot)
    expert.reset(env.snapshot, env.goal)
    pulled = 0
    while pulled < steps_into_pull:
        env.step(expert.act(env.snapshot, env.goal))
        pulled += expert.phase is Phase.PULL
        assert env.save_state().elapsed < 200, "the expert never gripped the handle"


def pixels_digest(observation: dict) -> str:
    """Over every number of a visual observation."""
    digest = hashlib.sha256(observation["agent"].tobytes())
    for part in (observation.get("rgbd") or observation["pointcloud"]).values():
        digest.update(part.tobytes())
    return digest.hexdigest()


@pytest.mark.parametrize("obs_mode", OBSERVATION_MODES)
def test_gymnasium_checker_is_silent(object_id: str, obs_mode: str) -> None:
    env = gym.make(f"ArtiSkill/{TASK}-v0", objects=object_id, obs_mode=obs_mode, render_mode="rgb_array")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=False)


def test_values_lie_in_their_spaces(object_id: str) -> None:
    env = make_env(object_id)
    observation, info = env.reset(seed=3)
    assert env.observation_space.contains(observation)
    assert set(info) == {"object", "level", "target", "success", "flags", "reward_terms"}
    assert sum(field.size for field in env.task.state_fields) == observation.shape[0]
    for action in random_actions(20):
        observation, reward, terminated, truncated, info = env.step(action)
        assert env.observation_space.contains(observation)
        assert np.isfinite(reward)
        assert np.isfinite(list(info["reward_terms"].values())).all()
        assert (terminated, truncated) == (False, False)
        assert info["success"] is False


def test_same_level_same_rollout(object_id: str) -> None:
    actions = random_actions(40)
    env = make_env(object_id)
    first = rollout(env, 5, actions)
    rollout(env, 6, actions[:7])
    assert_same(first, rollout(env, 5, actions))
    assert_same(first, rollout(make_env(object_id), 5, actions))
    assert not np.array_equal(first[0][0], rollout(env, 6, actions[:1])[0][0])


def test_two_processes_agree_on_every_bit(object_id: str) -> None:
    script = (
        "import numpy as np, hashlib\n"
        "from artiskill.envs.manipulation import ManipulationEnv\n"
        f"env = ManipulationEnv({TASK!r}, objects={object_id!r}); env.reset(seed=11)\n"
        "for a in np.random.default_rng(0).uniform(-1, 1, (60, 13)).astype(np.float32): env.step(a)\n"
        "print(hashlib.sha256(env.save_state().simulation.rows.tobytes()).hexdigest())\n"
    )
    command = [sys.executable, "-c", script]
    other = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    env = make_env(object_id)
    rollout(env, 11, random_actions(60))
    assert digest(env) == other


@pytest.mark.parametrize("obs_mode", VISUAL_MODES)
def test_same_level_same_pixels(object_id: str, obs_mode: str) -> None:
    env, other = make_env(object_id, obs_mode=obs_mode), make_env(object_id, obs_mode=obs_mode)
    seen = []
    for world, first in ((env, 6), (other, 5)):
        world.reset(seed=first)
        observation, _ = world.reset(seed=5)
        assert world.observation_space.contains(observation)
        seen.append([observation, *(world.step(action)[0] for action in random_actions(3))])
    assert [pixels_digest(o) for o in seen[0]] == [pixels_digest(o) for o in seen[1]]
    assert len({pixels_digest(o) for o in seen[0]}) == 4


@pytest.mark.parametrize("obs_mode", VISUAL_MODES)
def test_two_processes_agree_on_every_pixel(object_id: str, obs_mode: str) -> None:
    script = (
        "import numpy as np, hashlib\n"
        "from artiskill.envs.manipulation import ManipulationEnv\n"
        f"env = ManipulationEnv({TASK!r}, objects={object_id!r}, obs_mode={obs_mode!r}); env.reset(seed=11)\n"
        "for a in np.random.default_rng(0).uniform(-1, 1, (5, 13)).astype(np.float32): seen = env.step(a)[0]\n"
        "digest = hashlib.sha256(seen['agent'].tobytes())\n"
        f"for part in seen[{obs_mode!r}].values(): digest.update(part.tobytes())\n"
        "print(digest.hexdigest())\n"
    )
    command = [sys.executable, "-c", script]
    other = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    env = make_env(object_id, obs_mode=obs_mode)
    assert pixels_digest(rollout(env, 11, random_actions(5))[-1][0]) == other


@pytest.mark.parametrize("obs_mode", VISUAL_MODES)
def test_restoring_returns_the_same_pixels(object_id: str, obs_mode: str) -> None:
    env = make_env(object_id, obs_mode=obs_mode)
    observation = rollout(env, 1, random_actions(4))[-1][0]
    saved = env.save_state()
    rollout(env, 8, random_actions(2))
    assert pixels_digest(env.restore_state(saved)[0]) == pixels_digest(observation)
    stranger = make_env(object_id, obs_mode=obs_mode)
    assert pixels_digest(stranger.restore_state(saved)[0]) == pixels_digest(observation)


def test_modes_see_the_same_episode(object_id: str) -> None:
    """The same physics, the same rewards, the same robot; and no information about the object but pixels."""
    traces = {
        mode: rollout(make_env(object_id, obs_mode=mode), 2, random_actions(3)) for mode in OBSERVATION_MODES
    }
    for mode in VISUAL_MODES:
        for (seen, reward, flags), (state, same_reward, same_flags) in zip(
            traces[mode], traces["state"], strict=True
        ):
            assert (reward, flags) == (same_reward, same_flags)
            assert set(seen) == {mode, "agent"}
            np.testing.assert_array_equal(seen["agent"], state[-38:])


def test_restoring_in_contact_repeats_every_bit(object_id: str) -> None:
    env = make_env(object_id)
    grip_handle(env, level=2)
    saved = env.save_state()
    assert saved.simulation.rows.shape[0] == 1
    model, data = contacts_of(env)
    fingers = {model.geom(name).id for name in env._simulation.scene.robot.finger_geoms}
    assert any({c.geom1, c.geom2} & fingers for c in data.contact), "this test means to be in contact"

    def continue_from_here(world: ManipulationEnv) -> tuple[list, str]:
        trace = []
        for action in random_actions(100, seed=4) * 0.3:
            observation, reward, _, _, info = world.step(action)
            trace.append((observation, reward, info["flags"]))
        return trace, digest(world)

    first, first_digest = continue_from_here(env)
    env.restore_state(saved)
    again, again_digest = continue_from_here(env)
    assert_same(first, again)
    assert first_digest == again_digest
    stranger = make_env(object_id)
    stranger.reset(seed=99)
    stranger.restore_state(saved)
    elsewhere, elsewhere_digest = continue_from_here(stranger)
    assert_same(first, elsewhere)
    assert first_digest == elsewhere_digest


def test_restoring_returns_the_same_observation(object_id: str) -> None:
    env = make_env(object_id)
    grip_handle(env, level=1)
    observation, _, _, _, info = env.step(np.zeros(13, np.float32))
    saved = env.save_state()
    rollout(env, 8, random_actions(3))
    restored, restored_info = env.restore_state(saved)
    np.testing.assert_array_equal(restored, observation)
    assert restored_info == info


def test_asking_twice_answers_the_same(object_id: str) -> None:
    env = make_env(object_id)
    grip_handle(env, level=0, steps_into_pull=8)
    before = digest(env)
    snapshot, goal, task = env.snapshot, env.goal, env.task
    kept = {f.name: np.array(getattr(snapshot, f.name)) for f in fields(Snapshot)}
    flags = task.flags(snapshot, goal)
    for ask in (task.flags, partial(task.reward_terms, flags=flags)):
        first, second = ask(snapshot, goal), ask(snapshot, goal)
        for name in first:
            np.testing.assert_array_equal(first[name], second[name])
    np.testing.assert_array_equal(task.observe_state(snapshot, goal), task.observe_state(snapshot, goal))
    again = env._simulation.snapshot()
    for name, value in kept.items():
        np.testing.assert_array_equal(value, getattr(snapshot, name), err_msg=name)
        np.testing.assert_array_equal(value, getattr(again, name), err_msg=name)
    assert not bool(task.flags(snapshot, goal)["cabinet_static"][0]), "while it is pulled the drawer moves"
    assert digest(env) == before


@pytest.mark.parametrize("threads", [1, 2])
def test_a_batch_equals_single_environments(object_id: str, threads: int) -> None:
    env = make_env(object_id)
    levels, actions = (3, 4, 5), random_actions(3 * 25).reshape(25, 3, 13).astype(float)
    env.reset(seed=0)
    scene, obj = env._simulation.scene, env._casting.find(env.save_state().object)
    batch = Simulation(scene, num_envs=len(levels), num_threads=threads)
    generators = [level_generator(level, Stream.INITIAL_STATE) for level in levels]
    batch.reset([env.task.sample_initial_state(obj, g) for g in generators])
    for step_actions in actions:
        batch.step(env._scale.to_targets(step_actions))
    rows = batch.save().rows
    for i, level in enumerate(levels):
        env.reset(seed=level)
        for step_actions in actions:
            env.step(step_actions[i])
        np.testing.assert_array_equal(env.save_state().simulation.rows[0], rows[i])


def test_fixed_ids_and_splits_share_their_levels() -> None:
    mixed = gym.make(f"ArtiSkill/{TASK}-v0", objects="test")
    observation, info = mixed.reset(seed=17)
    for env_id in (f"{TASK}_{info['object']}-v0", f"{TASK}_{info['object']}_{info['target']}-v0"):
        fixed, fixed_info = gym.make(f"ArtiSkill/{env_id}").reset(seed=17)
        np.testing.assert_array_equal(fixed, observation)
        assert (fixed_info["object"], fixed_info["target"]) == (info["object"], info["target"])


def test_an_idle_robot_leaves_everything_as_it_is(object_id: str) -> None:
    env = make_env(object_id)
    env.reset(seed=4)
    start = env.snapshot
    for _ in range(20):
        env.step(idle_action(env))
    np.testing.assert_allclose(env.snapshot.robot_qpos, start.robot_qpos, atol=1e-5)
    np.testing.assert_allclose(env.snapshot.object_qpos, start.object_qpos, atol=1e-4)
    _, data = contacts_of(env)
    assert all(c.dist > -1e-3 for c in data.contact)


def idle_action(env: ManipulationEnv) -> np.ndarray:
    targets = np.zeros(13)
    targets[11:] = env.snapshot.robot_qpos[0, 11:]
    return env._scale.to_actions(targets).astype(np.float32)


def contacts_of(env: ManipulationEnv) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The engine's own view of the instant, to look at contacts."""
    model = env._simulation.scene.model
    data = mujoco.MjData(model)
    data.qpos[:] = np.concatenate((env.snapshot.robot_qpos[0], env.snapshot.object_qpos[0]))
    mujoco.mj_forward(model, data)
    return model, data


def deepest_contact(env: ManipulationEnv) -> float:
    _, data = contacts_of(env)
    return min((contact.dist for contact in data.contact), default=0.0)


@pytest.mark.parametrize("extreme", [False, True])
def test_wild_actions_never_explode(object_id: str, extreme: bool) -> None:
    env = make_env(object_id)
    env.reset(seed=1)
    actions = random_actions(200, seed=9)
    if extreme:
        actions = np.sign(np.repeat(actions[::10], 10, axis=0)).astype(np.float32)
    joints = [link.joint for link in env._casting.find(object_id).links if link.joint is not None]
    upper = np.array([joint.limits[1] for joint in joints])
    for action in actions:
        observation, _, _, _, _ = env.step(action)
        snapshot = env.snapshot
        assert np.isfinite(observation).all()
        assert np.abs(snapshot.robot_qvel).max() < 30
        assert np.abs(snapshot.object_qvel).max() < 30
        assert snapshot.tool_position_w[..., 2].min() > -0.02, "the hand does not fall through the floor"
        assert deepest_contact(env) > -0.01, "neither the cabinet nor its own trunk lets the robot through"
        assert (snapshot.object_qpos[0] < upper + 0.02).all()
        assert (snapshot.object_qpos[0] > -0.02).all()


def test_expert_solves_it_and_stages_are_ordered(object_id: str) -> None:
    """Rewards of a later stage exceed those of all earlier ones, over the states that an expert visits."""
    env = make_env(object_id)
    bonus = env.task.config.reward.stage_bonus
    by_stage: dict[int, list[float]] = {stage: [] for stage in range(4)}
    solved = []
    for level in range(3):
        env.reset(seed=level)
        expert = OpenCabinetExpert(env.task.robot)
        expert.reset(env.snapshot, env.goal)
        done = False
        while not done:
            _, reward, terminated, truncated, info = env.step(expert.act(env.snapshot, env.goal))
            by_stage[bonus.index(info["reward_terms"]["stage"])].append(reward)
            done = terminated or truncated
        solved.append(terminated)
        assert terminated == info["success"] == all(info["flags"].values())
    assert sum(solved) >= 2
    assert all(by_stage.values()), "the expert passes through all stages"
    for stage in range(3):
        assert max(by_stage[stage]) < min(by_stage[stage + 1])
