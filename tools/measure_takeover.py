"""Measure how experts go on from where somebody else left the robot: `python tools/measure_takeover.py TASK ...`.

For some steps, as many as the level draws from 0 to 120, another acts: `noise` drives every joint at random, with
a constant lean; a `student` does what the expert would, but slowly, with a lean, and shaking. Then the expert has
200 steps. Prints a table: solved, steps of the expert, and the targets that were solved least. An episode is lost
before the expert begins where nobody could solve it: the object has fallen over, its ball is out, or the ways to
the object and to its target are longer than the base drives in that time. With `--as-it-teaches`, the expert has
the values that `dagger` asks it with.
"""

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from artiskill.assets.catalog import list_objects, load_object
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ArtiSkillError
from artiskill.gallery.facts import markdown
from artiskill.learning.commands import commanding_expert
from artiskill.learning.train_config import teaching_values
from artiskill.tasks.move_bucket import ball_depth_m

MOST_STEPS, EXPERT_STEPS = 120, 200
BIAS, SHAKE, SHARE = 0.1, 0.3, 0.6  # of a student: its lean and noise in an action, what it does of what is wanted
NOISE_BIAS, NOISE = 0.5, 0.5
FALLEN_RAD = 0.6
Beginner = Callable[[np.ndarray, np.ndarray, np.random.Generator], np.ndarray]
NO_VALUES: Mapping[str, Any] = MappingProxyType({})


def student(wanted: np.ndarray, lean: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return the action of a student, given the expert's."""
    return SHARE * wanted + BIAS * lean + SHAKE * rng.normal(size=wanted.size)


def noise(wanted: np.ndarray, lean: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return a random action."""
    return NOISE_BIAS * lean + NOISE * rng.normal(size=wanted.size)


BEGINNERS: dict[str, Beginner] = {"nobody": lambda wanted, lean, rng: wanted, "student": student, "noise": noise}


@dataclass(frozen=True)
class Outcome:
    """What came of one episode; `steps` are the expert's; `lost`: nobody could have solved it from there."""

    object: str
    target: str
    level: int
    solved: bool
    steps: int
    lost: bool


def taken_over(env: ManipulationEnv, expert: Any, name: str, target: str, level: int, beginner: str) -> Outcome:
    """Play one level; `env` has time for both."""
    env.reset(options={"object": name, "target": target, "level": level})
    rng = np.random.default_rng([level, list(BEGINNERS).index(beginner), *f"{name} {target}".encode()])
    lean = rng.normal(size=env.action_space.shape)
    begins = 0 if beginner == "nobody" else int(rng.integers(0, MOST_STEPS + 1))
    expert.reset(env.snapshot, env.goal)
    solved, lost = False, False
    for step in range(begins + EXPERT_STEPS):
        if step == begins:
            lost = is_lost(env)
        action = expert.act(env.snapshot, env.goal)
        if step < begins:
            action = BEGINNERS[beginner](action, lean, rng)
        _, _, solved, _, _ = env.step(np.clip(action, -1.0, 1.0).astype(np.float32))
        if solved:
            break
    return Outcome(name, target, level, bool(solved), max(step + 1 - begins, 0), lost)


def is_lost(env: ManipulationEnv) -> bool:
    """Return whether nobody could solve the episode any more in the expert's time."""
    if env.task.category == "cabinet":
        return False
    now = env.snapshot
    if now.link_rotation_w[0, 0, 2, 2] < np.cos(FALLEN_RAD):
        return True
    if env.task.category == "bucket" and ball_depth_m(now, env.goal)[0] < 0:
        return True
    position = now.link_position_w[0, 0, :2]
    way = np.linalg.norm(position) + np.linalg.norm(position - now.robot_qpos[0, :2])
    return bool(way > EXPERT_STEPS * now.step_s * env.task.robot.actions.base_velocity_m_s)


def outcomes(
    task: str, objects: list[str], beginner: str, levels: range, values: Mapping[str, Any] = NO_VALUES
) -> Iterator[Outcome]:
    """Play levels of every target of some objects; `values` of the expert differ from its own."""
    for name in objects:
        env = ManipulationEnv(task, name, config={"episode_steps": MOST_STEPS + EXPERT_STEPS})
        expert = commanding_expert(env.task, values)
        for target in env.task.targets(load_object(name)):
            for level in levels:
                outcome = taken_over(env, expert, name, target, level, beginner)
                if outcome.steps:  # else another solved it before the expert's turn
                    yield outcome


def row(task: str, beginner: str, played: list[Outcome]) -> list[str]:
    """Of the table."""
    solved = [one for one in played if one.solved]
    targets = sorted({(one.object, one.target) for one in played})
    rates = {
        (name, target): np.mean([one.solved for one in played if (one.object, one.target) == (name, target)])
        for name, target in targets
    }
    worst = sorted(targets, key=lambda each: (rates[each], each))[:3]
    steps = f"{np.mean([one.steps for one in solved]):.0f}" if solved else ""
    kept = [one.solved for one in played if one.solved or not one.lost]
    return [
        *(task, beginner, str(len(targets)), str(len(played)), f"{len(solved) / len(played):.1%}"),
        *(str(len(played) - len(kept)), f"{np.mean(kept):.1%}" if kept else "", steps),
        ", ".join(
            f"{name} {target} {rates[name, target]:.0%}" for name, target in worst if rates[name, target] < 1
        ),
    ]


def measure(options: argparse.Namespace) -> list[list[str]]:
    """Return the rows of the table; say which episodes were not solved."""
    levels, rows = range(options.from_level, options.from_level + options.levels), []
    for task in options.tasks:
        objects = list_objects(split=options.objects, task=task)
        values = teaching_values(task) if options.as_it_teaches else NO_VALUES
        for beginner in options.beginners:
            played = list(outcomes(task, objects, beginner, levels, values))
            rows.append(row(task, beginner, played))
            for one in played:
                if not one.solved:
                    lost = ", lost before" if one.lost else ""
                    print(
                        f"not solved: {task} {beginner} {one.object} {one.target} {one.level}{lost}",
                        file=sys.stderr,
                    )
    return rows


def main(arguments: list[str]) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tasks", nargs="+")
    parser.add_argument("--objects", default="train", help="split (default: %(default)s)")
    parser.add_argument("--levels", type=int, default=2, help="of each target (default: %(default)s)")
    parser.add_argument("--from-level", type=int, default=1000, help="the first one (default: %(default)s)")
    parser.add_argument("--beginners", nargs="+", choices=BEGINNERS, default=list(BEGINNERS))
    parser.add_argument("--as-it-teaches", action="store_true", help="not with the values that it acts with")
    options = parser.parse_args(arguments)
    try:
        rows = measure(options)
    except ArtiSkillError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    head = ["task", "before the expert", "targets", "episodes", "solved", "lost before"]
    head += ["solved of the rest", "steps of the expert", "solved least"]
    print(markdown(head, rows))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
