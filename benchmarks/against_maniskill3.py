"""ArtiSkill against mani_skill 3 on the CPU: one environment, one core each, in turn, in one run.

    python benchmarks/against_maniskill3.py --partnet path/to/40147 --venv path/to/environment

mani_skill 3.0.1 gets an environment of its own (`--venv`, made if it is not there; about 3 GB with torch). What is
compared is the closest task that both have: opening the drawer of one PartNet-Mobility cabinet, loaded from the
same folder. Theirs is `OpenCabinetDrawer-v1` unchanged, with its Fetch robot (13 actions), dense reward, 20 Hz
control and 5 physics steps of 100 Hz each; the cabinet is scaled by 0.5, as those of its own list are about. Ours
is OpenCabinetDrawer with our one-armed robot (13 actions), dense reward with all terms, 20 Hz control and 25
physics steps of 500 Hz. Physics differ (SAPIEN: a convex hull per mesh; MuJoCo: a convex decomposition), so
that rates say what a user waits for, not what the engines can do. Random actions; resets are not timed. Time is
the process's CPU time, its threads' included, which other work on the machine hardly touches.

Modes: `state`; `pointcloud`: Fetch's own two cameras of 128 x 128 and as many of ours, full clouds; `three`:
colour, depth and segmentation of three cameras of 400 x 160 on the base; `three-pointcloud`: their full cloud.

Its loader asks for a Vulkan device even in state mode. Without a graphics card that is Mesa's lavapipe 24.3 or
later (earlier ones lack VK_KHR_external_semaphore_fd), found by the usual VK_ICD_FILENAMES.
"""

import argparse
import importlib
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
import venv
from collections.abc import Callable
from contextlib import ExitStack
from importlib.metadata import version
from pathlib import Path
from typing import Any

PINS = ("mani_skill==3.0.1", "torch==2.13.0")
SCALE = 0.5
MODES = ("state", "pointcloud", "three", "three-pointcloud")
THEIRS, OURS, VECTOR = "theirs", "ours", "ours-vector"
VECTOR_SIZE = 16
# environment steps of a round, by side and whether cameras see
STEPS = {THEIRS: (100, 5), OURS: (100, 25), VECTOR: (25, 5)}
PHYSICS_STEPS = {THEIRS: 5, OURS: 25, VECTOR: 25}
FETCH_PIXELS, FETCH_FOV_RAD = 128, 2.0
THREE = {"width": 400, "height": 160, "fov": math.radians(60), "near": 0.1, "far": 10.0}
EYE_HEIGHT_M, EYE_PITCH_RAD = 1.5, math.radians(45)
Round = Callable[[int], float]  # steps -> environment steps per second


# -- the sides, each in a process of its own -----------------------------------------------------------------


def their_env(mode: str, partnet: Path) -> Any:
    """mani_skill's environment with this cabinet; what is not imported above is in its environment only."""
    import gymnasium as gym
    import sapien
    import torch
    from mani_skill.agents.registration import register_agent
    from mani_skill.agents.robots import Fetch
    from mani_skill.envs.tasks.mobile_manipulation.open_cabinet_drawer import OpenCabinetDrawerEnv
    from mani_skill.sensors.camera import CameraConfig
    from mani_skill.utils.registration import register_env

    loader = importlib.import_module("mani_skill.utils.building.articulations.partnet_mobility")
    name = partnet.name
    loader.PARTNET_MOBILITY = {
        "model_data": {name: {"scale": SCALE}},
        "model_urdf_paths": {name: partnet / "mobility.urdf"},
    }
    torch.set_num_threads(1)
    listed = Path(tempfile.mkdtemp()) / "cabinets.json"
    listed.write_text(json.dumps({name: {}}), encoding="utf-8")

    @register_agent()
    class SeeingFetch(Fetch):
        uid = "fetch_three_cameras"

        @property
        def _sensor_configs(self) -> list[Any]:
            half, cameras = EYE_PITCH_RAD / 2, []
            for k in range(3):
                turn = k * math.pi / 3  # half the angle
                q = (
                    math.cos(turn) * math.cos(half),
                    -math.sin(turn) * math.sin(half),
                    math.cos(turn) * math.sin(half),
                    math.sin(turn) * math.cos(half),
                )
                pose = sapien.Pose([0, 0, EYE_HEIGHT_M], q)
                cameras.append(CameraConfig(uid=f"eye_{k}", pose=pose, entity_uid="base_link", **THREE))
            return cameras

    class OneCabinetEnv(OpenCabinetDrawerEnv):
        TRAIN_JSON = listed
        SUPPORTED_ROBOTS = ("fetch", SeeingFetch.uid)

        def _initialize_episode(self, env_idx: Any, options: dict[str, Any]) -> None:
            self.robot_uids, given = "fetch", self.robot_uids  # where the robot starts hangs on its name
            super()._initialize_episode(env_idx, options)
            self.robot_uids = given

    register_env("OneCabinet-v1", max_episode_steps=100)(OneCabinetEnv)
    return gym.make(
        "OneCabinet-v1",
        obs_mode={"state": "state", "three": "rgb+depth+segmentation"}.get(mode, "pointcloud"),
        robot_uids=SeeingFetch.uid if mode.startswith("three") else "fetch",
        sim_backend="physx_cpu",
        render_backend="cpu",
        reconfiguration_freq=0,
    )


def our_env(mode: str, partnet: Path, vector: bool) -> Any:
    """Our environment with this cabinet."""
    from artiskill.envs.manipulation import ManipulationEnv
    from artiskill.envs.vector_env import ManipulationVectorEnv

    settings = {
        "task": "OpenCabinetDrawer",
        "objects": str(partnet),
        "obs_mode": {"state": "state", "three": "rgbd"}.get(mode, "pointcloud"),
    }
    if mode == "pointcloud":
        eyes = {"number": 2, "width": FETCH_PIXELS, "height": FETCH_PIXELS, "fov_deg": math.degrees(FETCH_FOV_RAD)}
        settings["config"] = {f"cameras.{key}": value for key, value in eyes.items()}
    if vector:
        return ManipulationVectorEnv(VECTOR_SIZE, num_threads=1, copy=False, **settings)
    return ManipulationEnv(**settings)


def serve(side: str, mode: str, partnet: Path, core: int) -> None:
    """Make an environment; run as many steps as each line of standard input says, and answer with the rate."""
    os.sched_setaffinity(0, {core})
    env = their_env(mode, partnet) if side == THEIRS else our_env(mode, partnet, side == VECTOR)
    count = VECTOR_SIZE if side == VECTOR else 1
    env.action_space.seed(0)
    for number, line in enumerate(sys.stdin):
        env.reset(seed=number)
        actions = [env.action_space.sample() for _ in range(int(line))]
        start = time.process_time()  # of all threads; they have one core
        for action in actions:
            env.step(action)
        rate = count * len(actions) / (time.process_time() - start)
        print(json.dumps({"rate": rate, "memory_mb": resident_mb()}), flush=True)


def resident_mb() -> float:
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    return int(status.split("VmRSS:")[1].split()[0]) * 1024 / 1e6


# -- who asks them -------------------------------------------------------------------------------------------


class Side:
    """A process that serves."""

    def __init__(self, side: str, mode: str, python: Path, options: argparse.Namespace) -> None:
        self.steps = STEPS[side][mode != "state"]
        arguments = [
            "--serve",
            side,
            "--mode",
            mode,
            "--partnet",
            str(options.partnet),
            "--core",
            str(options.core),
        ]
        self._errors = tempfile.TemporaryFile("w+")  # noqa: SIM115 - it lives as long as the process
        self._process = subprocess.Popen(
            [python, __file__, *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            env=os.environ | {"OMP_NUM_THREADS": "1"},
        )

    def __enter__(self) -> "Side":
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        self._errors.close()

    def run(self, steps: int) -> dict[str, float]:
        """A round.

        Raises:
            RuntimeError: the process has ended; the last thing it said.
        """
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(f"{steps}\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            pass
        for line in self._process.stdout:
            if line.startswith("{"):
                return json.loads(line)
        self._errors.seek(0)
        raise RuntimeError((self._errors.read().strip().splitlines() or ["it ended without a word"])[-1])


def compare(mode: str, pythons: dict[str, Path], options: argparse.Namespace) -> dict[str, Any]:
    """Median rates of one mode, the sides in turn; what did not run has a text instead."""
    rounds: dict[str, list[dict[str, float]]] = {side: [] for side in pythons}
    row: dict[str, Any] = {"mode": mode}
    with ExitStack() as stack:
        sides = {side: stack.enter_context(Side(side, mode, pythons[side], options)) for side in pythons}
        for number in range(options.rounds + 1):  # the first compiles and fills caches
            for side, server in list(sides.items()):
                try:
                    found = server.run(server.steps)
                except RuntimeError as error:
                    row[side] = f"did not run: {error}"
                    del sides[side]
                    continue
                if number:
                    rounds[side].append(found)
    for side in sides:
        rate = statistics.median(one["rate"] for one in rounds[side])
        row[side] = {
            "steps_per_s": rate,
            "physics_steps_per_s": rate * PHYSICS_STEPS[side],
            "memory_mb": rounds[side][-1]["memory_mb"],
        }
    return row


def show(row: dict[str, Any]) -> None:
    theirs = row[THEIRS]
    for side in (THEIRS, OURS, VECTOR):
        found = row[side]
        if isinstance(found, str):
            print(f"{row['mode']:16} {side:11} {found}", flush=True)
            continue
        against = ""
        if side != THEIRS and not isinstance(theirs, str):
            more = (found[key] / theirs[key] for key in ("steps_per_s", "physics_steps_per_s"))
            against = "; {:.1f} times their steps, {:.1f} times their physics".format(*more)
        print(
            f"{row['mode']:16} {side:11} {found['steps_per_s']:7.1f} environment steps/s, "
            f"{found['physics_steps_per_s']:8.0f} physics steps/s, {found['memory_mb']:5.0f} MB{against}",
            flush=True,
        )


def their_python(folder: Path) -> Path:
    """The interpreter of an environment with mani_skill, which is made if it is not there."""
    python = folder / "bin" / "python"
    if not python.exists():
        print(f"installing {' and '.join(PINS)} into {folder} ...", flush=True)
        venv.create(folder, with_pip=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", *PINS], check=True)
    return python


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--partnet", type=Path, metavar="FOLDER", help="of a cabinet of PartNet-Mobility")
    parser.add_argument("--venv", type=Path, metavar="FOLDER", help="for mani_skill (default: a temporary one)")
    parser.add_argument("--mode", nargs="+", choices=MODES, default=list(MODES))
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--core", type=int, default=0, help="that both run on")
    parser.add_argument("--json", type=Path, help="also write the figures to this file")
    parser.add_argument("--serve", choices=tuple(STEPS), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.partnet is None:
        print("nothing measured: --partnet names the folder of a PartNet-Mobility cabinet, 40147 say; see --help")
        return
    options.partnet = options.partnet.resolve()
    if not (options.partnet / "mobility.urdf").is_file():
        parser.error(f"--partnet: {options.partnet} has no mobility.urdf")
    if options.serve:
        serve(options.serve, options.mode[0], options.partnet, options.core)
        return
    with tempfile.TemporaryDirectory() as temporary:
        theirs = their_python(options.venv or Path(temporary))
        pythons = {THEIRS: theirs, OURS: Path(sys.executable), VECTOR: Path(sys.executable)}
        rows = []
        for mode in options.mode:
            rows.append(compare(mode, pythons, options))
            show(rows[-1])
    print(f"artiskill {version('artiskill')}, {', '.join(PINS)}; core {options.core}, one at a time")
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
