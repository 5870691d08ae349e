"""Strips of demonstrations of one object, the most different ones: a row each, moments from left to right."""

from pathlib import Path

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.config import check
from artiskill.demos.demo_file import DemoFile
from artiskill.demos.trajectory import Trajectory
from artiskill.envs.observation import ObservationContext
from artiskill.evaluation.film import draw_instants
from artiskill.evaluation.pictures import check_picture, write_picture
from artiskill.evaluation.scene_pictures import PictureStyle
from artiskill.geometry.rotations import quat_to_matrix
from artiskill.sensors.pictures.compose import below, beside

_SAMPLES = 10  # of a trajectory, when it is compared with others
_HAND_SHARE = 0.3  # weight of joints, in radians, beside the base's place in metres


def picture_demos(
    path: Path | str,
    file: DemoFile,
    style: PictureStyle,
    count: int = 5,
    moments: int = 5,
    target: str | None = None,
    given: ArticulatedObject | None = None,
) -> list[int]:
    """Write the picture.

    Args:
        path: ends in .png or .jpg.
        file: of the object's demonstrations.
        style: how each moment is drawn.
        count: rows; all demonstrations, where there are fewer.
        moments: of each, evenly spaced from its begin to its end.
        target: only demonstrations of this link.
        given: the object, where no name leads to it.

    Returns:
        The numbers of the demonstrations, in order.

    Raises:
        ConfigError: an illegal path or number, or no demonstrations of the target.
        DemoError: the file is damaged, or of another catalogue.
    """
    check(not check_picture(path), f"strips are still pictures, .png or .jpg, not {Path(path).name!r}")
    check(count >= 1, f"the number of demonstrations must be at least 1, not {count}")
    check(moments >= 2, f"the number of moments must be at least 2, not {moments}")
    numbers = [k for k in range(len(file)) if target is None or file.trajectory(k).target == target]
    check(bool(numbers), f"{str(file.path)!r} has no demonstrations of {target or 'anything'}")
    chosen = most_different(file, numbers, count)
    obj = file.load_object(given)
    rows = [_strip(file.trajectory(number), file, obj, style, moments) for number in chosen]
    write_picture(path, below(rows))
    return chosen


def most_different(file: DemoFile, numbers: list[int], count: int) -> list[int]:
    """Numbers of demonstrations, in order: the first one, then always the one farthest from all chosen before.

    Far is how the robot goes: its base in the object's frame at the begin, and its joints.
    """
    ways = np.stack([_way(file.trajectory(number)) for number in numbers])
    chosen, nearest = [0], np.linalg.norm(ways - ways[0], axis=1)
    while len(chosen) < min(count, len(numbers)):
        chosen.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, np.linalg.norm(ways - ways[chosen[-1]], axis=1))
    return sorted(numbers[k] for k in chosen)


def _way(trajectory: Trajectory) -> np.ndarray:
    """Some moments of a trajectory, side by side."""
    states = trajectory.states
    steps = np.linspace(0, len(trajectory), _SAMPLES).astype(int)
    robot = states["robot_qpos"][steps].astype(np.float64)
    turn = quat_to_matrix(states["root_quaternion_w"][0].astype(np.float64))[:2, :2]
    base = (robot[:, :2] - states["root_position_w"][0, :2]) @ turn
    return np.concatenate((base, _HAND_SHARE * robot[:, 3:]), axis=1).ravel()


def _strip(
    trajectory: Trajectory, file: DemoFile, obj: ArticulatedObject, style: PictureStyle, moments: int
) -> np.ndarray:
    """Moments of a demonstration side by side, from one direction; it is simulated once more."""
    env = file.make_env(obj=obj)
    env.reset(options={"level": trajectory.level, "object": obj, "target": trajectory.target})
    steps = np.linspace(0, len(trajectory), moments).astype(int).tolist()
    instants = [ObservationContext(env.snapshot, env.goal, 0, trajectory.level, 0)]
    for step, action in enumerate(trajectory.actions, start=1):
        env.step(action)
        if step in steps:
            instants.append(ObservationContext(env.snapshot, env.goal, 0, trajectory.level, step))
    seconds = [instant.elapsed * env.snapshot.step_s for instant in instants]
    captions = [f"level {trajectory.level}, {trajectory.target}, {time_s:.1f} s" for time_s in seconds]
    return beside(list(draw_instants(env.task, env.scene, trajectory.target, instants, style, captions)))
