"""What is kept of one instant of an episode: rounded positions and velocities, the exact state, its digest."""

from dataclasses import fields
from hashlib import blake2b

import numpy as np

from artiskill.demos.columns import Columns
from artiskill.demos.config import StoreConfig
from artiskill.demos.settings import Settings
from artiskill.envs.state import EnvState
from artiskill.sim.snapshot import Snapshot
from artiskill.sim.states import SimulationState

DIGEST_BYTES = 8
STREAKS = "streaks"  # the episode's own part of a key frame; all else is the simulation's


def positions_of(snapshot: Snapshot, joints: int) -> dict[str, np.ndarray]:
    """Where everything is (B = 1); the object has so many joints, snapshots room for more."""
    return {
        "robot_qpos": snapshot.robot_qpos[0],
        "object_qpos": snapshot.object_qpos[0, :joints],
        "root_position_w": snapshot.link_position_w[0, 0],
        "root_quaternion_w": snapshot.link_quaternion_w[0, 0],
        "prop_position_w": snapshot.prop_position_w[0],
    }


def velocities_of(snapshot: Snapshot, joints: int) -> dict[str, np.ndarray]:
    """How fast everything moves (B = 1)."""
    return {
        "robot_qvel": snapshot.robot_qvel[0],
        "object_qvel": snapshot.object_qvel[0, :joints],
        "root_velocity_w": snapshot.root_velocity_w[0],
        "prop_velocity_w": snapshot.prop_velocity_w[0],
    }


def state_columns(snapshot: Snapshot, joints: int) -> Columns:
    """Columns of the rounded states."""
    return Columns.of(positions_of(snapshot, joints) | velocities_of(snapshot, joints))


def rounded(values: np.ndarray, bits: int) -> np.ndarray:
    """As float32 with so many bits behind the point: the zeros that follow are what makes it compress."""
    scale = 2.0**bits
    found: np.ndarray = (np.rint(values * scale) / scale).astype(np.float32)
    return found


def rounded_states(positions: np.ndarray, velocities: np.ndarray, store: StoreConfig) -> np.ndarray:
    """(N, P) positions and (N, V) velocities as the file keeps them, (N, P + V) float32."""
    return np.concatenate(
        (rounded(positions, store.position_bits), rounded(velocities, store.velocity_bits)), axis=1
    )


def frame_of(state: EnvState) -> dict[str, np.ndarray]:
    """All arrays that a state consists of, by name, without the batch dimension."""
    return simulation_arrays(state.simulation) | {STREAKS: np.asarray(state.streaks)}


def simulation_arrays(state: SimulationState) -> dict[str, np.ndarray]:
    """The arrays of a state of one environment."""
    values = {field.name: getattr(state, field.name) for field in fields(state)}
    return {name: value[0] for name, value in values.items() if isinstance(value, np.ndarray)}


def simulation_state(arrays: dict[str, np.ndarray], object_hash: str, settings: Settings) -> SimulationState:
    """The state whose `simulation_arrays` these are, of an object in a collection with these settings.

    Raises:
        DemoError: this version of the package has no such task.
    """
    batch = {name: value[None].copy() for name, value in arrays.items()}
    robot, physics, props = settings.setup
    return SimulationState(**batch, object_hash=object_hash, robot=robot, physics=physics, props=props)


def digest_of(state: SimulationState) -> int:
    """A number of 64 bits that is another one where a single bit of the physical state is another."""
    found = blake2b(digest_size=DIGEST_BYTES)
    for value in simulation_arrays(state).values():
        found.update(np.ascontiguousarray(value).data)
    return int.from_bytes(found.digest(), "little")
