"""What the robot sees needs no graphics driver: a process that looks has no such library in its memory."""

import subprocess
import sys
from pathlib import Path

import pytest

MAPS = Path("/proc/self/maps")
DRIVERS = (
    "libgl.",
    "libglx",
    "libgldispatch",
    "libegl",
    "libgles",
    "libosmesa",
    "libopengl",
    "libvulkan",
    "libglfw",
)
LOOK = """
import numpy as np
from pathlib import Path
from artiskill.envs.manipulation import ManipulationEnv
for mode in ("pointcloud", "rgbd"):
    env = ManipulationEnv("OpenCabinetDrawer", objects="cabinet-0005", obs_mode=mode, render_mode="rgb_array")
    env.reset(seed=1)
    seen = env.step(np.zeros(env.action_space.shape, dtype=np.float32))[0][mode]
    assert seen["rgb"].std() > 0 and seen["seg"].any(), "the cabinet is in view"
assert env.render().std() > 0
for line in Path("/proc/self/maps").read_text().splitlines():
    if "/" in line:
        print(line.split(maxsplit=5)[-1])
"""


@pytest.mark.slow
@pytest.mark.skipif(not MAPS.exists(), reason="only Linux tells which libraries a process has loaded")
def test_looking_loads_no_graphics_library() -> None:
    done = subprocess.run([sys.executable, "-c", LOOK], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    names = {Path(line).name.lower() for line in done.stdout.splitlines()}
    assert any("mujoco" in name for name in names), "the list is of libraries"
    assert not {name for name in names if name.startswith(DRIVERS)}
