"""When the fingers close, and when the hand begins anew: poses before a handle, without a simulation."""

import numpy as np
import pytest

from artiskill.config import CONFIG_DIR, load_config
from artiskill.experts.frames import Frame, axis_rotation
from artiskill.experts.grip import Phase, after_reach
from artiskill.experts.open_cabinet import OpenCabinetExpertConfig

CONFIG = load_config(OpenCabinetExpertConfig, CONFIG_DIR / "experts" / "open_cabinet.yaml").grip
GRASP = Frame(np.array((0.5, 0.2, 0.4)), np.eye(3))
PATIENCE = 30


def off(along: float = 0.0, across: float = 0.0, forward: float = 0.0, turned_rad: float = 0.0) -> Frame:
    """A hand that is so far from the grasp, m, and turned about the way forward."""
    rotation = axis_rotation(np.array((0.0, 0.0, 1.0)), turned_rad) if turned_rad else np.eye(3)
    return Frame(GRASP.position - rotation @ (along, across, forward), rotation)


@pytest.mark.parametrize(
    ("tool", "steps", "phase"),
    [
        (off(), 3, Phase.GRIP),
        (off(forward=0.05), 3, Phase.REACH),
        (off(across=0.01), 3, Phase.REACH),
        (off(along=0.012), 3, Phase.GRIP),  # along the handle it matters less
        (off(forward=0.012), CONFIG.blocked_steps - 1, Phase.REACH),
        (off(forward=0.012), CONFIG.blocked_steps, Phase.GRIP),  # something behind the handle is in its way
        (off(forward=0.02), CONFIG.blocked_steps, Phase.REACH),
        (off(forward=0.05, across=0.03), 3, Phase.APPROACH),  # lost, long before its patience ends
        (off(forward=0.05, turned_rad=0.4), 3, Phase.APPROACH),
        (off(forward=0.05), PATIENCE, Phase.APPROACH),
    ],
)
def test_what_follows_on_reaching_in(tool: Frame, steps: int, phase: Phase) -> None:
    assert after_reach(tool, GRASP, steps, PATIENCE, CONFIG) is phase
