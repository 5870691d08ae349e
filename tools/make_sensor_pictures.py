"""Make the pictures of docs/observations.md and docs/pictures.md anew: `python tools/make_sensor_pictures.py`.

`--out` writes them elsewhere, `--object` shows another cabinet.
"""

import argparse
from pathlib import Path

import numpy as np
from PIL import Image

from artiskill.assets.catalog import load_object
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.evaluation.pictures import EpisodeChoice, save_episode_picture
from artiskill.evaluation.scene_pictures import PictureStyle
from artiskill.experts.open_cabinet import OpenCabinetExpert
from artiskill.sensors.camera import Camera
from artiskill.sensors.observations.sampling import downsample, make_sampler
from artiskill.sensors.pictures.compose import below, beside, draw_points, paint_depth, paint_masks
from artiskill.sensors.pictures.objects import OrbitView, render_object

TASK, OBJECT, LEVEL, STEPS = "OpenCabinetDrawer", "cabinet-0023", 3, 60
OUT = Path(__file__).resolve().parents[1] / "docs" / "images"
SAMPLERS = ("maniskill", "voxel", "fps")


def save(path: Path, picture: np.ndarray) -> None:
    """As a PNG."""
    Image.fromarray(np.ascontiguousarray(picture)).save(path, optimize=True)
    print(f"{path}: {picture.shape[1]} x {picture.shape[0]}, {path.stat().st_size / 1e3:.0f} kB")


def reach_out(obs_mode: str, object_id: str) -> tuple[ManipulationEnv, dict]:
    """An environment in which the expert has opened a drawer part of the way, and what is seen then."""
    env = ManipulationEnv(TASK, objects=object_id, obs_mode=obs_mode)
    observation, _ = env.reset(seed=LEVEL)
    expert = OpenCabinetExpert(env.task.robot)
    expert.reset(env.snapshot, env.goal)
    for _ in range(STEPS):
        observation = env.step(expert.act(env.snapshot, env.goal))[0]
    return env, observation


def robot_view(object_id: str) -> np.ndarray:
    """Rows: colour, depth, masks; columns: the three cameras."""
    env, observation = reach_out("rgbd", object_id)
    rgb, depth, seg = (observation["rgbd"][name] for name in ("rgb", "depth", "seg"))
    rows = []
    for k in range(env.task.cameras.number):
        colour, masks = rgb[..., 3 * k : 3 * k + 3], seg[..., 3 * k : 3 * k + 3]
        rows.append([colour, paint_depth(depth[..., k], 7.0), paint_masks(colour, masks)])
    return below([beside(list(row)) for row in zip(*rows, strict=True)])


def clouds(object_id: str) -> np.ndarray:
    """The full cloud, in colour and with masks, and what samplers leave of it, from beside the robot."""
    env, observation = reach_out("pointcloud", object_id)
    cloud = observation["pointcloud"]
    x, y = env.snapshot.robot_qpos[0, :2]

    def drawn(width: int, points: dict[str, np.ndarray], radius_m: float, opacity: float) -> np.ndarray:
        eye, target = (x - 0.9, y - 2.2, 1.6), (x + 0.75, y + 0.35, 0.42)
        # the same breadth of view at any width
        height, fov = round(0.42 * width), 0.6
        camera = Camera.inspect_policy(eye, target, width=width, height=height, fov_rad=fov, far_m=20.0)
        there = points["rgb"].any(axis=1)
        colours = paint_masks(points["rgb"], points["seg"], opacity)[there]
        return draw_points(points["xyz"][there], colours, camera, radius_m)

    few = [
        downsample(**_world(cloud), sampler=make_sampler(m, 1200), rng=np.random.default_rng(0)) for m in SAMPLERS
    ]
    return below(
        [
            beside([drawn(648, cloud, 0.004, opacity) for opacity in (0.0, 0.7)]),
            beside([drawn(430, points, 0.015, 0.7) for points in few]),
        ]
    )


def _world(cloud: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {"xyz_w": cloud["xyz"], "rgb": cloud["rgb"], "seg": cloud["seg"]}


def render_sheet(folder: Path, object_id: str) -> None:
    """What `artiskill render --view all` writes, and an object alone, closed and open, side by side."""
    path = folder / "render_sheet.png"
    save_episode_picture(path, EpisodeChoice(TASK, object_id, level=LEVEL), PictureStyle(view="all"), STEPS)
    print(f"{path}: {path.stat().st_size / 1e3:.0f} kB")
    alone = [render_object(load_object(object_id), share, OrbitView(480, 400)) for share in (0.0, 0.8)]
    save(folder / "render_object.png", beside(alone))


def main() -> None:
    """Draw and save."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--object", default=OBJECT)
    parser.add_argument("--out", type=Path, default=OUT)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    save(options.out / "robot_view.png", robot_view(options.object))
    save(options.out / "point_clouds.png", clouds(options.object))
    render_sheet(options.out, options.object)


if __name__ == "__main__":
    main()
