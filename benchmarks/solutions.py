"""What it costs to play a policy in a process of its own: the same policy inside and outside of the evaluator.

    python benchmarks/solutions.py [--times 5] [--episodes 25] [--sandbox none]

plays uniform actions on four cabinets with drawers, half of them in each of two evaluators, so that two cores are
busy: given as a Python object, and as a solution file in the best confinement there is. Of states and of clouds of
1,200 points it prints episodes a second, their ratio in the same turn, and how much longer a step takes; then the
medians.
"""

import argparse
import statistics
import tempfile
import textwrap
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from artiskill import evaluate
from artiskill.evaluation.statistics import EpisodeResult

TASK, STEPS = "OpenCabinetDrawer", 200  # of an episode
OBJECTS = ("cabinet-0002", "cabinet-0003"), ("cabinet-0005", "cabinet-0010")  # of the two evaluators
MODES = {"state": 1.0, "pointcloud": 0.2}  # share of the episodes
SAMPLING = {"state": None, "pointcloud": {"num_points": 1200}}
SOLUTION = """
    import numpy as np

    class Policy:
        obs_mode, control_mode = "{mode}", "joint"
        sampling = {sampling}

        def reset(self, observation, info):
            self.generator = np.random.default_rng(0)

        def act(self, observation):
            return self.generator.uniform(-1.0, 1.0, 13)
"""


class Inside:
    """What `SOLUTION` does."""

    control_mode = "joint"

    def __init__(self, obs_mode: str) -> None:
        self.obs_mode, self.sampling = obs_mode, SAMPLING[obs_mode]

    def reset(self, observation: Any, info: Any) -> None:
        """Begin the actions anew."""
        self.generator = np.random.default_rng(0)

    def act(self, observation: Any) -> np.ndarray:
        """Return a uniform action."""
        return self.generator.uniform(-1.0, 1.0, 13)


def main() -> None:
    """Print a line for each turn."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--times", type=int, default=5)
    parser.add_argument("--episodes", type=int, default=25, help="of each cabinet")
    parser.add_argument("--sandbox")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(len(OBJECTS), get_context("spawn")) as pool:
        for mode, share in MODES.items():
            outside_file = Path(folder, f"{mode}.py")
            outside_file.write_text(textwrap.dedent(SOLUTION.format(mode=mode, sampling=SAMPLING[mode])))
            episodes = max(1, round(share * options.episodes))
            turns = []
            for turn in range(options.times + 1):
                inside = rate(pool, Inside(mode), episodes, None)
                outside = rate(pool, outside_file, episodes, options.sandbox)
                if turn:  # the first one warms up
                    longer_ms = 1e3 * len(OBJECTS) / STEPS * (1 / outside - 1 / inside)
                    turns.append([inside, outside, outside / inside, longer_ms])
                    print(line(mode, turns[-1]), flush=True)
            print(line(f"{mode}, medians", [statistics.median(column) for column in zip(*turns, strict=True)]))


def rate(pool: ProcessPoolExecutor, policy: Any, episodes: int, sandbox: str | None) -> float:
    """Return the episodes a second of the evaluators together."""
    return sum(ended.result() for ended in [pool.submit(play, policy, ids, episodes, sandbox) for ids in OBJECTS])


def play(policy: Any, objects: Sequence[str], episodes: int, sandbox: str | None) -> float:
    """Return the episodes a second of an evaluation, without the first one of each object, which waits."""
    ends: dict[str, list[float]] = {name: [] for name in objects}

    def note(result: EpisodeResult) -> None:
        ends[result.object].append(time.perf_counter())

    evaluate(TASK, policy, objects, episodes, sandbox=sandbox, on_episode=note)
    return (episodes - 1) * len(objects) / sum(times[-1] - times[0] for times in ends.values())


def line(name: str, row: Sequence[float]) -> str:
    """Return what is printed of a turn."""
    return name + ": inside {:.2f} episodes/s, outside {:.2f}, {:.0%}, {:+.3f} ms a step".format(*row)


if __name__ == "__main__":
    main()
