"""What every task promises for every object: spaces, levels, bits, purity, ordered stages, sane physics."""

import hashlib
import subprocess
import sys
import warnings
from dataclasses import fields
from functools import cache, partial
from itertools import pairwise

import gymnasium as gym
import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from artiskill.assets.articulated_object import Joint
from artiskill.assets.needs import task_needs
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.options import OBSERVATION_MODES
from artiskill.errors import PolicyError
from artiskill.evaluation.policies import load_policy
from artiskill.experts.handle_grasp import CabinetPhase
from artiskill.experts.open_cabinet import OpenCabinetExpert
from artiskill.experts.registry import make_expert
from artiskill.sim.simulation import Simulation
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.levels import RngStream, level_generator
from artiskill.tasks.registry import make_task, task_names

VISUAL_MODES = tuple(mode for mode in OBSERVATION_MODES if mode != "state")


ACTIONS = {1: 13, 2: 22}  # numbers in an action, by arms
ROBOT_NUMBERS = {1: 38, 2: 68}  # the robot's part of the state vector, by arms


def make_env(task: str, object_id: str, **kwargs) -> ManipulationEnv:
    return ManipulationEnv(task, objects=object_id, **kwargs)


@cache
def arms_of(task: str) -> int:
    return len(make_task(task).robot.mounts)


def random_actions(task: str, count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1, 1, (count, ACTIONS[arms_of(task)])).astype(np.float32)


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


def engage(env: ManipulationEnv, level: int, steps_on: int = 5) -> None:
    """Bring robot and object into contact: the gripper pulls the handle, or the robot drives into the object.

    Experts do not come to some handles (cups) at all levels: then it is the next level.
    """
    if env.task.category == "cabinet":
        assert any(pulls(env, level + more, steps_on) for more in (0, 1)), "the expert never gripped the handle"
        return
    env.reset(seed=level)
    while steps_on:
        env.step(toward_object(env))
        steps_on -= touches_object(env)
        assert env.save_state().elapsed < 200, "the robot never reached the object"


def pulls(env: ManipulationEnv, level: int, steps: int) -> bool:
    """Return whether the expert comes to pull the handle; it has then done so for some steps."""
    env.reset(seed=level)
    expert = OpenCabinetExpert(env.task.robot)
    while steps and env.save_state().elapsed < 200:
        command = expert.command(env.snapshot, env.goal)
        env.step(expert.controller.action(env.snapshot, command))
        steps -= command.phase == CabinetPhase.PULL
    return not steps


def toward_object(env: ManipulationEnv) -> np.ndarray:
    """Drive at the object, with the lift going down to where hands or platform meet it."""
    x, y, yaw = env.snapshot.robot_qpos[0, :3]
    offset = env.snapshot.link_position_w[0, 0, :2] - (x, y)
    along = np.array(((np.cos(yaw), np.sin(yaw)), (-np.sin(yaw), np.cos(yaw)))) @ offset
    targets = env.snapshot.robot_qpos[0].copy()
    targets[:] = 0.0
    targets[:2] = 0.5 * along / np.linalg.norm(along)
    targets[3] = -0.3
    return env.control.joint_scale.to_actions(targets)


def touches_object(env: ManipulationEnv) -> bool:
    model, data = contacts_of(env)
    robot = {model.body(name).id for name in env.simulation.scene.robot.bodies}
    links = env.simulation.scene.index.object_bodies
    pairs = [{int(model.geom_bodyid[c.geom1]), int(model.geom_bodyid[c.geom2])} for c in data.contact]
    return any(pair & robot and pair & set(range(links.start, links.stop)) for pair in pairs)


def pixels_digest(observation: dict) -> str:
    """Over every number of a visual observation."""
    digest = hashlib.sha256(observation["agent"].tobytes())
    for part in (observation.get("rgbd") or observation["pointcloud"]).values():
        digest.update(part.tobytes())
    return digest.hexdigest()


@pytest.mark.parametrize("obs_mode", OBSERVATION_MODES)
def test_gymnasium_checker_is_silent(task: str, object_id: str, obs_mode: str) -> None:
    env = gym.make(f"ArtiSkill/{task}-v0", objects=object_id, obs_mode=obs_mode, render_mode="rgb_array")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=False)


def test_values_lie_in_their_spaces(task: str, object_id: str) -> None:
    env = make_env(task, object_id)
    observation, info = env.reset(seed=3)
    assert env.observation_space.contains(observation)
    assert set(info) == {"object", "level", "target", "success", "flags", "reward_terms"}
    assert sum(field.size for field in env.task.state_fields) == observation.shape[0]
    for action in random_actions(task, 20):
        observation, reward, terminated, truncated, info = env.step(action)
        assert env.observation_space.contains(observation)
        assert np.isfinite(reward)
        assert np.isfinite(list(info["reward_terms"].values())).all()
        assert (terminated, truncated) == (False, False)
        assert info["success"] is False


def test_same_level_same_rollout(task: str, object_id: str) -> None:
    actions = random_actions(task, 40)
    env = make_env(task, object_id)
    first = rollout(env, 5, actions)
    rollout(env, 6, actions[:7])
    assert_same(first, rollout(env, 5, actions))
    assert_same(first, rollout(make_env(task, object_id), 5, actions))
    assert not np.array_equal(first[0][0], rollout(env, 6, actions[:1])[0][0])


def test_two_processes_agree_on_every_bit_and_pixel(task: str, object_id: str) -> None:
    script = (
        "import numpy as np, hashlib\n"
        "from artiskill.envs.manipulation import ManipulationEnv\n"
        f"env = ManipulationEnv({task!r}, objects={object_id!r}); env.reset(seed=11)\n"
        f"actions = np.random.default_rng(0).uniform(-1, 1, (60, {ACTIONS[arms_of(task)]})).astype(np.float32)\n"
        "for a in actions: env.step(a)\n"
        "print(hashlib.sha256(env.save_state().simulation.rows.tobytes()).hexdigest())\n"
        f"for mode in {VISUAL_MODES!r}:\n"
        f"    env = ManipulationEnv({task!r}, objects={object_id!r}, obs_mode=mode); env.reset(seed=11)\n"
        "    for a in actions[:5]: seen = env.step(a)[0]\n"
        "    digest = hashlib.sha256(seen['agent'].tobytes())\n"
        "    for part in seen[mode].values(): digest.update(part.tobytes())\n"
        "    print(digest.hexdigest())\n"
    )
    command = [sys.executable, "-c", script]
    bits, *pixels = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    env, actions = make_env(task, object_id), random_actions(task, 60)
    rollout(env, 11, actions)
    assert digest(env) == bits
    for obs_mode, there in zip(VISUAL_MODES, pixels, strict=True):
        env = make_env(task, object_id, obs_mode=obs_mode)
        assert pixels_digest(rollout(env, 11, actions[:5])[-1][0]) == there, obs_mode


@pytest.mark.parametrize("obs_mode", VISUAL_MODES)
def test_same_level_same_pixels(task: str, object_id: str, obs_mode: str) -> None:
    env, other = make_env(task, object_id, obs_mode=obs_mode), make_env(task, object_id, obs_mode=obs_mode)
    seen = []
    for world, first in ((env, 6), (other, 5)):
        world.reset(seed=first)
        observation, _ = world.reset(seed=5)
        assert world.observation_space.contains(observation)
        seen.append([observation, *(world.step(action)[0] for action in random_actions(task, 3))])
    assert [pixels_digest(o) for o in seen[0]] == [pixels_digest(o) for o in seen[1]]
    assert len({pixels_digest(o) for o in seen[0]}) == 4


@pytest.mark.parametrize("obs_mode", VISUAL_MODES)
def test_restoring_returns_the_same_pixels(task: str, object_id: str, obs_mode: str) -> None:
    env = make_env(task, object_id, obs_mode=obs_mode)
    observation = rollout(env, 1, random_actions(task, 4))[-1][0]
    saved = env.save_state()
    rollout(env, 8, random_actions(task, 2))
    assert pixels_digest(env.restore_state(saved)[0]) == pixels_digest(observation)
    stranger = make_env(task, object_id, obs_mode=obs_mode)
    assert pixels_digest(stranger.restore_state(saved)[0]) == pixels_digest(observation)


def test_modes_see_the_same_episode(task: str, object_id: str) -> None:
    """The same physics, the same rewards, the same robot; and no information about the object but pixels."""
    traces = {
        mode: rollout(make_env(task, object_id, obs_mode=mode), 2, random_actions(task, 3))
        for mode in OBSERVATION_MODES
    }
    for mode in VISUAL_MODES:
        for (seen, reward, flags), (state, same_reward, same_flags) in zip(
            traces[mode], traces["state"], strict=True
        ):
            assert (reward, flags) == (same_reward, same_flags)
            assert set(seen) == {mode, "agent"}
            np.testing.assert_array_equal(seen["agent"], state[-ROBOT_NUMBERS[arms_of(task)] :])


def test_restoring_in_contact_repeats_every_bit(task: str, object_id: str) -> None:
    env = make_env(task, object_id)
    engage(env, level=2)
    saved = env.save_state()
    assert saved.simulation.rows.shape[0] == 1
    assert touches_object(env), "this test means to be in contact"

    def continue_from_here(world: ManipulationEnv) -> tuple[list, str]:
        trace = []
        for action in random_actions(task, 100, seed=4) * 0.3:
            observation, reward, _, _, info = world.step(action)
            trace.append((observation, reward, info["flags"]))
        return trace, digest(world)

    first, first_digest = continue_from_here(env)
    env.restore_state(saved)
    again, again_digest = continue_from_here(env)
    assert_same(first, again)
    assert first_digest == again_digest
    stranger = make_env(task, object_id)
    stranger.reset(seed=99)
    stranger.restore_state(saved)
    elsewhere, elsewhere_digest = continue_from_here(stranger)
    assert_same(first, elsewhere)
    assert first_digest == elsewhere_digest


def test_restoring_returns_the_same_observation(task: str, object_id: str) -> None:
    env = make_env(task, object_id)
    engage(env, level=1)
    observation, _, _, _, info = env.step(np.zeros(ACTIONS[arms_of(task)], np.float32))
    saved = env.save_state()
    rollout(env, 8, random_actions(task, 3))
    restored, restored_info = env.restore_state(saved)
    np.testing.assert_array_equal(restored, observation)
    assert restored_info == info


def test_asking_twice_answers_the_same(task: str, object_id: str) -> None:
    env = make_env(task, object_id)
    engage(env, level=0, steps_on=8)
    before = digest(env)
    snapshot, goal, made = env.snapshot, env.goal, env.task
    kept = {f.name: np.array(getattr(snapshot, f.name)) for f in fields(Snapshot)}
    flags = made.flags(snapshot, goal)
    for ask in (made.flags, partial(made.reward_terms, flags=flags)):
        first, second = ask(snapshot, goal), ask(snapshot, goal)
        for name in first:
            np.testing.assert_array_equal(first[name], second[name])
    np.testing.assert_array_equal(made.observe_state(snapshot, goal), made.observe_state(snapshot, goal))
    again = env.simulation.snapshot()
    for name, value in kept.items():
        np.testing.assert_array_equal(value, getattr(snapshot, name), err_msg=name)
        np.testing.assert_array_equal(value, getattr(again, name), err_msg=name)
    moves = np.max(snapshot.link_speed_m_s), np.max(snapshot.link_angular_speed_rad_s)
    assert max(moves) > 0.005, "what is pulled or pushed moves"
    assert digest(env) == before


@pytest.mark.parametrize("threads", [1, 2])
def test_a_batch_equals_single_environments(task: str, object_id: str, threads: int) -> None:
    env = make_env(task, object_id)
    levels, actions = (3, 4, 5), random_actions(task, 3 * 25).reshape(25, 3, -1).astype(float)
    env.reset(seed=0)
    scene, obj = env.simulation.scene, env._episodes.samplers[0].find(env.save_state().object)
    batch = Simulation(scene, num_envs=len(levels), num_threads=threads)
    generators = [level_generator(level, RngStream.INITIAL_STATE) for level in levels]
    batch.reset([env.task.sample_initial_state(obj, g) for g in generators])
    for step_actions in actions:
        batch.step(env.control.joint_scale.to_targets(step_actions))
    rows = batch.save().rows
    for i, level in enumerate(levels):
        env.reset(seed=level)
        for step_actions in actions:
            env.step(step_actions[i])
        np.testing.assert_array_equal(env.save_state().simulation.rows[0], rows[i])


@pytest.mark.parametrize("task", task_names())
def test_fixed_ids_and_splits_share_their_levels(task: str) -> None:
    mixed = gym.make(f"ArtiSkill/{task}-v0", objects="test")
    observation, info = mixed.reset(seed=17)
    ids = [f"{task}_{info['object']}-v0"]
    ids += [f"{task}_{info['object']}_{info['target']}-v0"] if task_needs(task).motion else []
    for env_id in ids:
        fixed, fixed_info = gym.make(f"ArtiSkill/{env_id}").reset(seed=17)
        np.testing.assert_array_equal(fixed, observation)
        assert (fixed_info["object"], fixed_info["target"]) == (info["object"], info["target"])


def test_an_idle_robot_leaves_everything_as_it_is(task: str, object_id: str) -> None:
    env = make_env(task, object_id)
    env.reset(seed=4)
    if task == "MoveBucket":  # the ball is still falling
        for _ in range(20):
            env.step(idle_action(env))
    start = env.snapshot
    for _ in range(20):
        env.step(idle_action(env))
    np.testing.assert_allclose(env.snapshot.robot_qpos, start.robot_qpos, atol=1e-5)
    # casters give a little under the weight of a chair, a ball rolls out
    give = {"cabinet": 1e-4, "chair": 5e-3, "bucket": 5e-3}[env.task.category]
    own = np.flatnonzero(np.isfinite([j.limits[0] for j in object_joints(env)]))
    np.testing.assert_allclose(env.snapshot.object_qpos[:, own], start.object_qpos[:, own], atol=give)
    np.testing.assert_allclose(env.snapshot.link_position_w[:, 0], start.link_position_w[:, 0], atol=give)
    assert deepest_contact(env) > -1e-3
    won = env.task.flag_names[WON_BY.get(task, 0)]
    assert not env.task.flags(env.snapshot, env.goal)[won][0]


# the flag, by its place, that no episode starts with and doing nothing never brings, where it is not the first
WON_BY = {"MoveBucket": 1}


def idle_action(env: ManipulationEnv) -> np.ndarray:
    """Zero velocities, fingers where they are."""
    targets = np.zeros(env.control.size)
    for arm in range(len(env.task.robot.mounts)):
        fingers = slice(11 + 9 * arm, 13 + 9 * arm)
        targets[fingers] = env.snapshot.robot_qpos[0, fingers]
    return env.control.joint_scale.to_actions(targets).astype(np.float32)


def object_joints(env: ManipulationEnv) -> list[Joint]:
    return [link.joint for link in env.simulation.scene.object.links if link.joint is not None]


def contacts_of(env: ManipulationEnv) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The engine's own view of the instant, to look at contacts."""
    model = env.simulation.scene.model
    data = mujoco.MjData(model)
    data.qpos[:] = env.simulation._qpos[0]
    mujoco.mj_forward(model, data)
    return model, data


def deepest_contact(env: ManipulationEnv) -> float:
    _, data = contacts_of(env)
    return min((contact.dist for contact in data.contact), default=0.0)


@pytest.mark.parametrize("extreme", [False, True])
def test_wild_actions_never_explode(task: str, object_id: str, extreme: bool) -> None:
    env = make_env(task, object_id)
    env.reset(seed=1)
    actions = random_actions(task, 200, seed=9)
    if extreme:
        actions = np.sign(np.repeat(actions[::10], 10, axis=0)).astype(np.float32)
    limits = np.array([joint.limits for joint in object_joints(env)]).reshape(-1, 2)
    own, rolls = len(limits), ~np.isfinite(limits[:, 0])  # wheels may turn faster than anything else
    for action in actions:
        observation, _, _, _, _ = env.step(action)
        snapshot = env.snapshot
        assert np.isfinite(observation).all()
        assert np.abs(snapshot.robot_qvel).max() < 30
        assert np.abs(snapshot.object_qvel[:, :own][:, ~rolls]).max(initial=0) < 30
        assert np.abs(snapshot.object_qvel[:, :own][:, rolls]).max(initial=0) < 200
        assert np.abs(snapshot.root_velocity_w[:, :3]).max() < 10
        assert snapshot.tool_position_w[..., 2].min() > -0.02, "the hand does not fall through the floor"
        assert snapshot.link_position_w[..., 2].min() > -0.02, "and neither does the object"
        assert (snapshot.prop_position_w[..., 2] > 0.03).all(), "nor the ball"
        assert deepest_contact(env) > -0.01, "neither the object nor its own trunk lets the robot through"
        assert (snapshot.object_qpos[0, :own] < limits[:, 1] + 0.03).all()
        assert (snapshot.object_qpos[0, :own] > limits[:, 0] - 0.03).all()


def test_expert_solves_it_and_stages_are_ordered(task: str, object_id: str) -> None:
    """Rewards of a later stage exceed those of all earlier ones, over the states that an expert visits."""
    env, expert = make_env(task, object_id), load_policy("expert")
    try:
        make_expert(task, env.task.robot)
    except PolicyError as error:  # a new task may come before its expert
        pytest.skip(str(error))
    bonus = env.task.config.reward.stage_bonus
    by_stage: dict[int, list[float]] = {stage: [] for stage in range(len(bonus))}
    solved = []
    for level in range(3):
        observation, info = env.reset(seed=level)
        expert.reset(env, observation, info)
        done = False
        while not done:
            observation, reward, terminated, truncated, info = env.step(expert.act(env, observation))
            stage = int(np.searchsorted(bonus, info["reward_terms"]["stage"], side="right")) - 1
            by_stage[stage].append(reward)
            done = terminated or truncated
        solved.append(terminated)
        assert terminated == info["success"] == all(info["flags"].values())
    assert sum(solved) >= 2
    assert by_stage[0]
    assert by_stage[len(bonus) - 1]
    visited = [rewards for rewards in by_stage.values() if rewards]
    for lower, higher in pairwise(visited):
        assert max(lower) < min(higher)


def test_wild_states_keep_the_order_of_stages(task: str, object_id: str) -> None:
    """Rewards of states that random actions reach fall into the range of their stage."""
    env = make_env(task, object_id)
    bonus = np.append(env.task.config.reward.stage_bonus, np.inf)
    for level in range(5):
        env.reset(seed=level)
        for action in random_actions(task, 20, seed=level):
            _, reward, _, _, info = env.step(action)
            stage = int(np.searchsorted(bonus, info["reward_terms"]["stage"], side="right")) - 1
            assert bonus[stage] <= reward < bonus[stage + 1]
