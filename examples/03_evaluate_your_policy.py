"""Evaluate three policies from Python: the expert, a solution file, and an object of your own."""

import argparse
from pathlib import Path

import numpy as np

import artiskill


class Sway:
    """A policy as a class: it may remember, and it is told when an episode begins."""

    obs_mode = "state"

    def reset(self, observation: np.ndarray, info: dict) -> None:
        """An episode begins; `info` has `object`, `level` and `target`."""
        self.step = 0

    def act(self, observation: np.ndarray) -> np.ndarray:
        """Turn the base left and right."""
        self.step += 1
        action = np.zeros(13)
        action[2] = np.sin(self.step / 5)
        return action


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--objects", nargs="+", default=["test"])
    parser.add_argument("--episodes", type=int, default=2)
    arguments = parser.parse_args()
    for policy in ("expert", Path(__file__).with_name("solution_example.py"), Sway()):
        report = artiskill.evaluate("OpenCabinetDrawer", policy, arguments.objects, arguments.episodes)
        low, high = report.total.interval
        print(f"{report.policy}: {report.success_rate:.0%} solved, between {low:.0%} and {high:.0%}")


if __name__ == "__main__":
    main()
