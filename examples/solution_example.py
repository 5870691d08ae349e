"""The simplest solution file: drive forward with an open hand. It solves nothing; start from here.

Evaluate it: `artiskill evaluate --policy examples/solution_example.py --objects test --episodes 2`
"""

import numpy as np


def policy(observation: np.ndarray) -> np.ndarray:
    """An observation, (D,) float32, to an action, 13 numbers in [-1, 1]: see `help(artiskill.ManipulationEnv)`."""
    action = np.zeros(13)
    action[0] = 0.5  # base, forward: half of 0.5 m/s
    action[11:] = 1.0  # fingers: as far open as they go
    return action
