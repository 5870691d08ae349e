"""`RunPolicy`: a training run as a policy, by torch, on one thread of the CPU; its export to act without."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import torch

from artiskill.errors import ConfigError, PolicyError, RunError
from artiskill.learning.algorithm import Algorithm
from artiskill.learning.array_policy import Header, check_policy_path, make_actor, write_policy
from artiskill.learning.batch import Observation
from artiskill.learning.checkpoints import load_weights, make_algorithm, read_content
from artiskill.learning.recovery import RecoveryConfig
from artiskill.learning.run import FROM_STATE, RunInfo, read_info, run_folder, weights_file
from artiskill.learning.train_config import TrainConfig, algorithm_class, read_train_config

if TYPE_CHECKING:  # it needs the engine's kernels
    from artiskill.learning.commands import CommandActor


class RunPolicy:
    """What a run has learned; it sees point clouds, and remembers nothing.

    Args:
        run: the run's folder, whose best checkpoint acts, else its latest; or one of its checkpoints.

    Attributes:
        obs_mode, control_mode, sampling, observation_config: as evaluation asks of a policy.

    Raises:
        PolicyError: there is no checkpoint.
        RunError: the run is damaged or of another version.
    """

    obs_mode = "pointcloud"

    def __init__(self, run: Path | str) -> None:
        info, _, self._algorithm = load_trained(run)
        self.control_mode, self.sampling = info.control_mode, info.sampling
        self.observation_config = info.observation_config
        self._layout = info.layout
        self._actor: CommandActor | None = make_actor(info.commands) if info.commands else None

    def reset(self, observation: Any, info: Mapping[str, Any]) -> None:
        """Begin an episode: there is nothing to remember."""

    def act(self, observation: Any) -> np.ndarray:
        """Return the action, (A,) in [-1, 1], of an observation of mode `pointcloud`.

        It is float32, or float64 where commands become actions by inverse kinematics.

        Raises:
            ConfigError: an observation of other sizes.
        """
        arrays = self._layout.observe(observation)
        with one_thread():
            tensors = Observation(*(torch.from_numpy(array) for array in arrays))
            found = self._algorithm.act(tensors)[0].numpy()
        return found if self._actor is None else self._actor.action(arrays.agent[0], found)


class StatePolicy:
    """What a run of reinforcement learning has learned: it sees the state, and acts without noise.

    Args:
        run: the run's folder, whose best checkpoint acts, else its latest; or one of its checkpoints.

    Attributes:
        obs_mode, control_mode, observation_config: as evaluation asks of a policy.

    Raises:
        PolicyError: there is no checkpoint.
        RunError: the run is damaged or of another version.
    """

    obs_mode = "state"
    control_mode = "joint"

    def __init__(self, run: Path | str) -> None:
        path = weights_file(run)
        try:
            self._take(read_content(path)["acting"])
        except (LookupError, TypeError, AttributeError) as error:
            raise RunError(f"{str(path)!r} does not fit the run: {error}") from error

    @classmethod
    def of(cls, acting: Mapping[str, Any]) -> Self:
        """Return the policy of weights, as a checkpoint has them."""
        made = cls.__new__(cls)
        made._take(acting)
        return made

    def _take(self, acting: Mapping[str, Any]) -> None:
        self._layers = list(zip(acting["weights"], acting["biases"], strict=True))
        self._activation = {"relu": torch.relu, "tanh": torch.tanh}[acting["activation"]]
        self._squash = {"tanh": torch.tanh, "clip": partial(torch.clip, min=-1.0, max=1.0)}[acting["squash"]]
        self._mean, self._std, self._clip = acting["mean"], acting["std"], float(acting["clip"])
        self.observation_config: dict[str, Any] = acting.get("observation_config", {})  # runs of before have none

    def reset(self, observation: Any, info: Mapping[str, Any]) -> None:
        """Begin an episode: there is nothing to remember."""

    def act(self, observation: Any) -> np.ndarray:
        """Return the action, (A,) float32 in [-1, 1], of an observation of mode `state`.

        Raises:
            ConfigError: an observation of another size.
        """
        given = np.asarray(observation)
        if given.shape != self._mean.shape:
            raise ConfigError(f"the policy learned from states {tuple(self._mean.shape)}, not {given.shape}")
        return self.act_all(given[None])[0]

    def act_all(self, observations: np.ndarray) -> np.ndarray:
        """Return the actions (B, A) of observations (B, D)."""
        with one_thread(), torch.inference_mode():
            values = ((torch.from_numpy(observations) - self._mean) / self._std).clip(-self._clip, self._clip)
            values = values.float()
            for weight, bias in self._layers[:-1]:
                values = self._activation(values @ weight.T + bias)
            weight, bias = self._layers[-1]
            found: np.ndarray = self._squash(values @ weight.T + bias).numpy()
        return found


def load_trained(run: Path | str) -> tuple[RunInfo, TrainConfig, Algorithm]:
    """Return what a run says of itself, its values, and its algorithm with the weights to act by, on the CPU.

    Args:
        run: the run's folder, or one of its checkpoints.

    Raises:
        PolicyError: there is no checkpoint.
        RunError: the run is damaged or of another version.
        ConfigError: it learned commands, for which the engine's packages are needed, and one is missing.
    """
    weights, folder = weights_file(run), run_folder(run)
    info = read_info(folder)
    if info.algorithm in FROM_STATE:
        raise PolicyError(f"{str(folder)!r} learned from the state; only policies of point clouds are exported")
    config = read_train_config(folder)
    algorithm_class(config.name)  # where a package is missing, the run is not damaged
    try:
        algorithm = make_algorithm(config, info)
    except (ConfigError, TypeError, LookupError) as error:
        raise RunError(f"{str(folder)!r} is damaged: {error}") from error
    load_weights(weights, algorithm)
    return info, config, algorithm.requires_grad_(False).eval()


def export_policy(run: Path | str, path: Path, recovery: bool = False) -> Header:
    """Write the policy of a run to one file that acts by NumPy alone, see `ArrayPolicy`; return what it says.

    Args:
        run: the run's folder, or one of its checkpoints.
        path: of the file; its name ends in `.npz`.
        recovery: give a command of another kind where the policy stands still, see `RecoveryConfig`.

    Raises:
        PolicyError: there is no checkpoint, or the file cannot be written.
        RunError: the run is damaged or of another version.
        ConfigError: no file can have that name, or the run learned no commands, which recovery needs.
    """
    check_policy_path(path)
    info, config, algorithm = load_trained(run)
    header = Header(
        task=info.task,
        algorithm=info.algorithm,
        control_mode=info.control_mode,
        sampling=info.sampling,
        observation_config=info.observation_config,
        frame=info.sampling["frame"],
        **info.sizes,
        network=config.network,
        commands=info.commands,
        recovery=RecoveryConfig() if recovery else None,
    )
    write_policy(path, header, {name: value.numpy() for name, value in algorithm.state_dict().items()})
    return header


def weights_step(run: Path | str) -> tuple[int, int]:
    """Return after which step a run's weights were saved, see `weights_file`, and how many steps were asked for.

    Raises:
        PolicyError: there is no checkpoint.
        RunError: the run is damaged or of another version.
    """
    state = read_content(weights_file(run))["state"]
    return state["step"], read_train_config(run_folder(run)).steps


@contextmanager
def one_thread() -> Iterator[None]:
    """Have torch use one thread of the CPU: the same bits in every process, and none to wait for."""
    before = torch.get_num_threads()
    if before != 1:
        torch.set_num_threads(1)
    try:
        yield
    finally:
        if before != 1:
            torch.set_num_threads(before)
