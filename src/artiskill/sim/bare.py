"""The engine with nothing around it: the ceiling that everything else is measured against."""

import copy

import numpy as np
from mujoco.batch import Batch

from artiskill.sim.simulation import Simulation


class BareEngine:
    """`mujoco.batch.Batch` and no more, with the models and states that a simulation has now.

    Its `step` does the physics of `Simulation.step`, bit for bit, and leaves out whatever else that does: fields
    that are current after the step, previous poses, checks.

    Args:
        simulation: is read once, not kept.
    """

    def __init__(self, simulation: Simulation) -> None:
        models = [copy.copy(model) for model in simulation._models]
        self._batch = Batch(models[0], simulation.num_envs, simulation.num_threads)
        self._batch.set_models(models)
        self._batch.state[:] = simulation._batch.state
        self._ctrl = self._batch.bind("ctrl")
        self._physics_steps = simulation.scene.physics.physics_steps_per_step

    def step(self, targets: np.ndarray) -> None:
        """One environment step under drive targets (B, R)."""
        self._ctrl[:] = targets
        self._batch.step(nstep=self._physics_steps)

    @property
    def state(self) -> np.ndarray:
        """(B, S) the engine's integration state; a live view."""
        return self._batch.state
