"""What the robot sees: shapes, masks, geometry, frames, down-sampling."""

import math
import warnings
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.wrappers import PointCloudDownsample
from artiskill.errors import ConfigError, UnknownNameError
from artiskill.sensors.observations.sampling import SAMPLERS, ManiskillSampler, downsample
from artiskill.tasks.levels import RngStream, level_generator
from artiskill.tasks.registry import make_task

OBJECT = "cabinet-0003"
PAGE = Path(__file__).resolve().parents[2] / "docs" / "observations.md"
HANDLE, LINK, ROBOT = range(3)


def make(obs_mode: str = "pointcloud", **kwargs) -> ManipulationEnv:
    return ManipulationEnv(objects=OBJECT, obs_mode=obs_mode, **kwargs)


def drive_closer(env: gym.Env, steps: int = 12) -> tuple[dict, dict]:
    """Half a second towards the cabinet, so that handle and link fill more of the pictures."""
    env.reset(seed=3)
    for _ in range(steps):
        action = np.zeros(13, np.float32)
        action[0] = 1.0
        observation, _, _, _, info = env.step(action)
    return observation, info


def to_pixels(xyz: np.ndarray, info: dict, camera: int) -> tuple[np.ndarray, np.ndarray]:
    """World points to pixel coordinates (x, y) and depth, by what `info` says alone."""
    cameras = info["cameras"]
    seen = np.c_[xyz, np.ones(len(xyz))] @ cameras["world_to_camera"][camera].T
    pixels = seen[:, :3] @ cameras["intrinsics"][camera].T
    return pixels[:, :2] / pixels[:, 2:], pixels[:, 2]


def test_shapes_are_the_benchmarks() -> None:
    cloud, info = make().reset(seed=0)
    assert {k: (v.shape, v.dtype) for k, v in cloud["pointcloud"].items()} == {
        "xyz": ((192000, 3), np.float32),
        "rgb": ((192000, 3), np.uint8),
        "seg": ((192000, 3), np.bool_),
    }
    images, _ = make("rgbd").reset(seed=0)
    assert {k: (v.shape, v.dtype) for k, v in images["rgbd"].items()} == {
        "rgb": ((160, 400, 9), np.uint8),
        "depth": ((160, 400, 3), np.float32),
        "seg": ((160, 400, 9), np.bool_),
    }
    assert (images["agent"].shape, images["agent"].dtype) == ((38,), np.float32)
    state_info = make("state").reset(seed=0)[1]
    assert set(info) - set(state_info) == {"cameras"}, "nothing more about the object than in mode state"
    np.testing.assert_equal({k: v for k, v in info.items() if k != "cameras"}, state_info)


def test_both_modes_say_the_same() -> None:
    cloud = drive_closer(make())[0]["pointcloud"]
    observation, info = drive_closer(make("rgbd"))
    rgbd = observation["rgbd"]
    for camera in range(3):
        part = slice(64000 * camera, 64000 * (camera + 1))
        np.testing.assert_array_equal(
            cloud["rgb"][part].reshape(160, 400, 3), rgbd["rgb"][..., 3 * camera : 3 * camera + 3]
        )
        np.testing.assert_array_equal(
            cloud["seg"][part].reshape(160, 400, 3), rgbd["seg"][..., 3 * camera : 3 * camera + 3]
        )
        xyz, depth = cloud["xyz"][part], rgbd["depth"][..., camera].reshape(-1)
        seen = depth > 0
        pixels, expected_depth = to_pixels(xyz[seen], info, camera)
        np.testing.assert_allclose(depth[seen], expected_depth, atol=1e-5)
        rows, columns = np.divmod(np.flatnonzero(seen), 400)
        np.testing.assert_allclose(pixels, np.c_[columns + 0.5, rows + 0.5], atol=1e-2)
        assert not xyz[~seen].any()


def test_masks_lie_on_what_they_name() -> None:
    env = make()
    cloud = drive_closer(env)[0]["pointcloud"]
    xyz, seg = cloud["xyz"], cloud["seg"]
    assert seg[:, HANDLE].sum() >= 20
    assert seg[seg[:, HANDLE], LINK].all(), "the handle is part of the link"
    assert seg[:, LINK].sum() > seg[:, HANDLE].sum()
    assert not (seg[:, ROBOT] & seg[:, LINK]).any()
    goal, snapshot = env.goal, env.snapshot
    handle = goal.handle_points[0].T @ snapshot.link_rotation_w[0, goal.link[0]].T
    handle += snapshot.link_position_w[0, goal.link[0]]
    for point in xyz[seg[:, HANDLE]]:
        assert np.linalg.norm(handle - point, axis=1).min() < 0.03
    robot = xyz[seg[:, ROBOT]]
    assert len(robot) > 1000, "the robot sees itself"
    reach = np.linalg.norm(robot[:, :2] - snapshot.robot_qpos[0, :2], axis=1)
    assert reach.max() < 1.2
    untouched = ~seg.any(axis=1) & (xyz[:, 2] > 1e-3)
    assert untouched.any(), "the rest of the cabinet"


def test_another_target_has_other_masks() -> None:
    env = make()
    targets = env.task.targets(env._episodes.samplers[0].find(OBJECT))
    seen = [env.reset(options={"level": 3, "target": target})[0]["pointcloud"] for target in targets[:2]]
    np.testing.assert_array_equal(seen[0]["rgb"], seen[1]["rgb"])
    assert (seen[0]["seg"][:, LINK] != seen[1]["seg"][:, LINK]).any()
    again = env.reset(options={"level": 3, "target": targets[0]})[0]["pointcloud"]
    np.testing.assert_array_equal(again["seg"], seen[0]["seg"])


def test_cameras_follow_the_base_and_not_the_lift() -> None:
    env = make(config={"cameras.width": 20, "cameras.height": 10})
    _, before = env.reset(seed=0)
    action = np.zeros(13, np.float32)
    action[3] = 1.0
    for _ in range(20):
        _, _, _, _, info = env.step(action)
    assert env.snapshot.robot_qpos[0, 3] > 0.2, "the lift went up"
    np.testing.assert_allclose(info["cameras"]["world_to_camera"], before["cameras"]["world_to_camera"], atol=5e-3)
    action[:4] = (1.0, 0.0, 0.5, 0.0)
    for _ in range(10):
        _, _, _, _, info = env.step(action)
    x, y, yaw = env.snapshot.robot_qpos[0, :3]
    pose = np.eye(4)
    pose[:2, :2] = ((math.cos(yaw), -math.sin(yaw)), (math.sin(yaw), math.cos(yaw)))
    pose[:2, 3] = x, y
    np.testing.assert_allclose(
        info["cameras"]["world_to_camera"] @ pose, info["cameras"]["robot_to_camera"], atol=1e-9
    )
    np.testing.assert_array_equal(info["cameras"]["robot_to_camera"], before["cameras"]["robot_to_camera"])


@pytest.mark.parametrize("obs_mode", ["pointcloud", "rgbd"])
def test_cameras_are_configuration(obs_mode: str) -> None:
    changes = {"number": 2, "width": 50, "height": 30, "mount_height_m": 2.0, "fov_deg": 40.0}
    env = make(obs_mode, config={"cameras": changes})
    observation, info = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    shapes = {k: v.shape for k, v in observation[obs_mode].items()}
    if obs_mode == "pointcloud":
        assert shapes == {"xyz": (3000, 3), "rgb": (3000, 3), "seg": (3000, 3)}
    else:
        assert shapes == {"rgb": (30, 50, 6), "depth": (30, 50, 2), "seg": (30, 50, 6)}
    camera_to_world = np.linalg.inv(info["cameras"]["world_to_camera"])
    np.testing.assert_allclose(camera_to_world[:, 2, 3], 2.0)


def test_observations_are_the_callers_to_keep() -> None:
    env = make("rgbd", config={"cameras.width": 40, "cameras.height": 16})
    first, info = env.reset(seed=0)
    kept = {k: v.copy() for k, v in first["rgbd"].items()}
    extrinsics = info["cameras"]["robot_to_camera"].copy()
    info["cameras"]["robot_to_camera"][:] = 0
    action = np.ones(13, np.float32)
    for _ in range(3):
        _, _, _, _, info = env.step(action)
    for name, value in kept.items():
        np.testing.assert_array_equal(first["rgbd"][name], value)
    np.testing.assert_array_equal(info["cameras"]["robot_to_camera"], extrinsics)


def test_one_environment_sees_one_cabinet_after_another() -> None:
    env = ManipulationEnv(objects=["cabinet-0003", "cabinet-0005"], obs_mode="pointcloud")
    first = env.reset(options={"level": 0, "object": "cabinet-0003"})[0]["pointcloud"]
    other = env.reset(options={"level": 0, "object": "cabinet-0005"})[0]["pointcloud"]
    again = env.reset(options={"level": 0, "object": "cabinet-0003"})[0]["pointcloud"]
    assert (first["rgb"] != other["rgb"]).any()
    for name in first:
        np.testing.assert_array_equal(first[name], again[name])


def test_the_page_tells_what_the_configuration_says() -> None:
    task = make().task
    c = task.cameras
    higher = make_task("PushChair").cameras
    text = PAGE.read_text(encoding="utf-8")
    for row in (
        f"| height above the floor | {c.mount_height_m:g} m; PushChair {higher.mount_height_m:g} m |",
        f"| pitch | {c.pitch_down_deg:g} degrees down |",
        f"| vertical field of view | {c.fov_deg:g} degrees |",
        f"| resolution | {c.width} x {c.height} pixels, square |",
        f"| near, far | {c.near_m:g} m, {c.far_m:g} m along the optical axis |",
        f"| `xyz` | ({c.pixels}, 3) float32 |",
        f"| `rgb` | ({c.height}, {c.width}, {3 * c.number}) uint8 |",
        *(f"| `{method}` |" for method in SAMPLERS),
    ):
        assert row in text
    assert task.mask_names == ("handle", "link", "robot")


# -- down-sampling -----------------------------------------------------------------------------------------------


def test_the_wrapper_draws_what_the_full_cloud_would_give() -> None:
    few, _ = drive_closer(PointCloudDownsample(make()))
    full, _ = drive_closer(make())
    cloud = (full["pointcloud"][name] for name in ("xyz", "rgb", "seg"))
    expected = downsample(*cloud, ManiskillSampler(), level_generator(3, RngStream.POINTS, 12))
    for name, values in expected.items():
        np.testing.assert_array_equal(few["pointcloud"][name], values)
    np.testing.assert_array_equal(few["agent"], full["agent"])


@pytest.mark.parametrize("method", SAMPLERS)
def test_the_wrapper_keeps_the_contract(method: str) -> None:
    env = PointCloudDownsample(
        gym.make("ArtiSkill/OpenCabinetDrawer-v0", objects=OBJECT, obs_mode="pointcloud"), method, 300
    )
    observation, info = drive_closer(env)
    assert env.observation_space.contains(observation)
    assert observation["pointcloud"]["xyz"].shape == (300, 3)
    assert observation["pointcloud"]["xyz"][:, 2].min() > 1e-3
    assert "cameras" in info
    saved = env.unwrapped.save_state()
    env.step(np.ones(13, np.float32))
    restored, _ = env.unwrapped.restore_state(saved)
    again, _ = drive_closer(env)
    for name, values in observation["pointcloud"].items():
        np.testing.assert_array_equal(restored["pointcloud"][name], values)
        np.testing.assert_array_equal(again["pointcloud"][name], values)


def test_the_choice_changes_from_step_to_step() -> None:
    env = PointCloudDownsample(make())
    env.reset(seed=0)
    action = np.zeros(13, np.float32)
    seen = [env.step(action)[0]["pointcloud"]["xyz"] for _ in range(2)]
    assert (np.abs(seen[0] - seen[1]) > 1e-2).any()


def test_gymnasiums_checker_accepts_the_wrapped_environment() -> None:
    env = PointCloudDownsample(make(), "voxel", num_points=200, voxel_m=0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*different from the unwrapped version.*")
        check_env(env, skip_render_check=True)


def test_frames_hold_the_same_points() -> None:
    clouds, env = {}, None
    for frame in ("world", "robot", "end_effector"):
        env = PointCloudDownsample(make(), num_points=600, frame=frame)
        observation, _ = drive_closer(env)
        assert env.observation_space.contains(observation)
        clouds[frame] = observation["pointcloud"]
    snapshot = env.unwrapped.snapshot
    x, y, yaw = snapshot.robot_qpos[0, :3]
    turn = np.array(((math.cos(yaw), -math.sin(yaw), 0), (math.sin(yaw), math.cos(yaw), 0), (0, 0, 1)))
    world = clouds["world"]["xyz"]
    np.testing.assert_allclose(clouds["robot"]["xyz"] @ turn.T + (x, y, 0), world, atol=1e-5)
    in_hand = clouds["end_effector"]["xyz"] @ snapshot.tool_rotation_w[0, 0].T + snapshot.tool_position_w[0, 0]
    np.testing.assert_allclose(in_hand, world, atol=1e-5)
    np.testing.assert_array_equal(clouds["robot"]["seg"], clouds["world"]["seg"])


def test_padding_stays_zero_in_every_frame() -> None:
    small = {"cameras.width": 16, "cameras.height": 8}
    for frame in ("world", "robot", "end_effector"):
        cloud = PointCloudDownsample(make(config=small), frame=frame).reset(seed=0)[0]["pointcloud"]
        assert not cloud["xyz"][400:].any()
        assert cloud["xyz"][:5].any()


def test_what_the_wrapper_refuses() -> None:
    with pytest.raises(ConfigError, match="obs_mode='pointcloud', not 'rgbd'"):
        PointCloudDownsample(make("rgbd"))
    with pytest.raises(ConfigError, match="not None"):
        PointCloudDownsample(gym.make("CartPole-v1"))
    with pytest.raises(UnknownNameError, match="'fps'"):
        PointCloudDownsample(make(), "fpss")
    with pytest.raises(UnknownNameError, match="end_effector"):
        PointCloudDownsample(make(), frame="end_efector")
    with pytest.raises(ConfigError, match="voxel_m"):
        PointCloudDownsample(make(), "voxel", voxel=0.1)
    with pytest.raises(ConfigError, match="already"):
        PointCloudDownsample(PointCloudDownsample(make()))
    with pytest.raises(ConfigError, match="before the wrappers"):
        PointCloudDownsample(
            gym.wrappers.FlattenObservation(make(config={"cameras.width": 4, "cameras.height": 2}))
        )


def test_light_and_floor_are_the_configurations() -> None:
    """Two environments of one scene in one process, each with its own light; masks and depth stay the same."""
    dark = {"render.sun.strength": 0.0, "render.ambient": {"sky": [0, 0, 0], "ground": [0, 0, 0]}}
    lamp = {"position_w": [-1.0, 0.0, 2.0], "colour": [1.0, 1.0, 1.0], "strength": 3.0, "range_m": 8.0}
    plain = make("rgbd").reset(seed=0)[0]["rgbd"]
    changes = {
        "dark": dark,
        "lit": {**dark, "render.lamps": [lamp]},
        "blue": {"render.background.horizon": [0, 0, 1], "render.floor.enabled": False},
        "picture": {"render.quality": "picture", "cameras": {"width": 100, "height": 40}},
    }
    seen = {name: make("rgbd", config=config).reset(seed=0)[0]["rgbd"] for name, config in changes.items()}
    again = make("rgbd").reset(seed=0)[0]["rgbd"]
    np.testing.assert_array_equal(again["rgb"], plain["rgb"])
    for name in ("dark", "lit"):
        np.testing.assert_array_equal(seen[name]["depth"], plain["depth"])
        np.testing.assert_array_equal(seen[name]["seg"], plain["seg"])
    thing = plain["seg"][..., ROBOT]
    means = [view["rgb"][..., :3][thing].mean() for view in (seen["dark"], seen["lit"], plain)]
    assert means[0] < 1
    assert means[0] + 20 < means[1]
    assert means[0] + 20 < means[2]
    sky = (seen["blue"]["depth"][..., 0] == 0) & ~thing
    assert sky.any()
    assert (seen["blue"]["rgb"][..., :3][sky] == (0, 0, 255)).all()
    assert len(np.unique(seen["picture"]["rgb"])) > 50
