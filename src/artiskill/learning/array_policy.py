"""`ArrayPolicy`: a trained policy in one file of arrays that acts by NumPy alone. Imports no torch.

The file is an `.npz`: `header`, a text (`Header` as JSON), and the arrays that acting needs, named as in the
algorithm's `state_dict`.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from artiskill.config import check, check_inside, from_mapping, to_mapping
from artiskill.errors import ArtiSkillError, ConfigError, PolicyError, check_name, closest, shown
from artiskill.files import DAMAGED_ARCHIVE, atomic_write, check_archive, open_regular, output_path, parse_json
from artiskill.learning.array_networks import Weights, make_array_network
from artiskill.learning.features import make_features
from artiskill.learning.network_config import FRAMES, NetworkConfig
from artiskill.learning.observation import MOST_MASKS, REAL, ObservationArrays, ObservationLayout
from artiskill.learning.recovery import Recovery, RecoveryConfig

if TYPE_CHECKING:  # it needs the engine's kernels
    from artiskill.learning.commands import CommandActor

SUFFIX = ".npz"
FORMAT, VERSION = "artiskill-policy", 2
# algorithm -> the parts of its `state_dict` that acting needs
PARTS: Mapping[str, tuple[str, ...]] = {
    "bc": ("policy.",),
    "td3bc": ("policy.",),
    "bcq": ("decoder.", "critics.0.", "latents"),
    "dagger": ("policy.",),
    "command_bc": ("policy.",),
}
_PACKAGED = Path(__file__).with_name("pretrained")  # policies that come with the package, a file for each task
_HEADER = "header"
_MOST_BYTES = 1_000_000_000  # the paper's largest network has 20 MB, twice in BCQ
_MOST_POINTS, _MOST_AGENT, _MOST_ACTION = 1_000_000, 10_000, 1_000


@dataclass(frozen=True)
class Header:
    """What a policy file says of itself."""

    task: str
    algorithm: str
    control_mode: str  # of the actions
    sampling: dict[str, Any]  # of the clouds, as `Sampling` has it
    observation_config: dict[str, Any]  # sections `cameras`, `render` and `state`, as in training
    frame: str  # of their points
    points: int  # of a cloud
    masks: int  # of a cloud
    agent: int  # numbers in the robot's state
    action: int  # numbers in an action
    network: NetworkConfig
    commands: dict[str, Any] = field(default_factory=dict)  # a `CommandSpace`, where the network gives commands
    recovery: RecoveryConfig | None = None  # what is done where commands move nothing, if anything

    def __post_init__(self) -> None:
        check_name("algorithm", self.algorithm, PARTS)
        check_name("frame", self.frame, FRAMES)
        check_inside("points", self.points, (1, _MOST_POINTS))
        check_inside("masks", self.masks, (0, MOST_MASKS))
        check_inside("agent", self.agent, (1, _MOST_AGENT))
        check_inside("action", self.action, (1, _MOST_ACTION))
        frame = self.sampling.get("frame", FRAMES[0])
        check(frame == self.frame, f"points are in frame {self.frame!r}, and are sampled in {shown(frame)}")
        check(bool(self.commands) or not self.network.input.body, "network.input.body needs commands")
        needs = f"recovery needs commands, which dagger and command_bc learn, not {self.algorithm}"
        check(bool(self.commands) or self.recovery is None, needs)


def check_policy_path(path: Path) -> Path:
    """Return the path of a policy file to be written.

    Raises:
        ConfigError: no file can be written there, or its name does not end in `.npz`.
    """
    path = output_path(path)
    check(path.suffix == SUFFIX, f"the name of a policy file must end in {SUFFIX}, not {shown(path.name)}")
    return path


def write_policy(path: Path, header: Header, weights: Mapping[str, np.ndarray]) -> None:
    """Write a policy file, whole or not at all.

    Args:
        path: of the file; its name ends in `.npz`.
        header: what it is.
        weights: of the whole algorithm, as its `state_dict` names them; what acting needs is written.

    Raises:
        ConfigError: as of `check_policy_path`.
        PolicyError: the file cannot be written; an earlier one is as it was.
    """
    path = check_policy_path(path)
    needed = {name: np.asarray(one) for name, one in weights.items() if name.startswith(PARTS[header.algorithm])}
    text = json.dumps({"format": FORMAT, "version": VERSION, **to_mapping(header)})
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_write(path) as temporary, temporary.open("wb") as file:
            np.savez(file, **{_HEADER: np.array(text), **needed})  # type: ignore[arg-type]
    except OSError as error:
        raise PolicyError(f"cannot write {str(path)!r}: {error.strerror}") from error


def pretrained_file(task: str) -> Path:
    """Return the file of the policy that comes with the package for a task.

    Raises:
        PolicyError: there is none.
    """
    path = _PACKAGED / f"{task}{SUFFIX}"
    if not path.is_file():
        names = sorted(one.stem for one in _PACKAGED.glob(f"*{SUFFIX}"))
        text = f"no trained policy comes with the package for {task}; for {', '.join(names) or 'none'} one does"
        if str(task).endswith(SUFFIX):
            text += f"; ArrayPolicy({str(task)!r}) loads a file"
        elif near := closest(task, names):
            text += f"; did you mean {near!r}?"
        raise PolicyError(text)
    return path


def load_policy(task: str) -> "ArrayPolicy":
    """Return the policy that comes with the package for a task; it sees point clouds and needs no torch.

    It acts on thinned clouds, which its environment has to give::

        policy = load_policy("PushChair")
        env = gym.make("ArtiSkill/PushChair-v0", obs_mode=policy.obs_mode, control_mode=policy.control_mode)
        env = Sampling(**policy.sampling).wrap(env)  # artiskill.envs.wrappers
        observation, _ = env.reset(seed=0)
        action = policy.act(observation)

    Args:
        task: name of one of the benchmark's tasks.

    Raises:
        PolicyError: none comes with the package for it.
    """
    return ArrayPolicy(pretrained_file(task))


def make_actor(commands: Mapping[str, Any]) -> "CommandActor":
    """Return what carries commands out, of the plain values of their `CommandSpace`."""
    from artiskill.learning.commands import CommandActor, CommandSpace

    return CommandActor(from_mapping(CommandSpace, commands, "commands"))


class ArrayPolicy:
    """A policy of a file that `artiskill export-policy` wrote; it sees point clouds.

    It acts as the training run that it was exported from, to 1e-5, except where it recovers (`Header.recovery`);
    without recovery it remembers nothing. Where two candidates (of `bcq`) are worth the same to seven digits, or
    two kinds of commands (of `dagger`, `command_bc`) as likely, the one or the other may be taken.

    Args:
        path: of the file.

    Attributes:
        obs_mode, control_mode, sampling, observation_config: as evaluation asks of a policy.
        header: what the file says of itself.

    Raises:
        PolicyError: there is no such file, or it is damaged, foreign or of another version.
    """

    obs_mode = "pointcloud"

    def __init__(self, path: Path | str) -> None:
        self.header, values = _read(Path(path))
        self.control_mode, self.sampling = self.header.control_mode, self.header.sampling
        self.observation_config = self.header.observation_config
        self._layout = ObservationLayout(self.header.points, self.header.masks, self.header.agent)
        self._input = self.header.network.resolved().input
        try:
            self._actor = make_actor(self.header.commands) if self.header.commands else None
        except ConfigError as error:
            raise PolicyError(f"{str(path)!r} is damaged: {error}") from error
        recovery, config = self.header.recovery, self.header.network
        self._recovery = None if recovery is None else Recovery(recovery)
        try:
            if self.header.algorithm == "bcq":
                self._latents = values["latents"]
                decoder, critic = (Weights(values, part) for part in ("decoder.", "critics.0."))
                self._scale = decoder.scale
                self._networks = [make_array_network(config, part) for part in (decoder, critic)]
            else:
                weights = Weights(values, "policy.")
                self._scale, self._networks = weights.scale, [make_array_network(config, weights)]
            shape = self._choose(self._anything()).shape
        except (LookupError, ValueError, TypeError) as error:
            raise PolicyError(f"{str(path)!r} is damaged: its weights do not fit its network") from error
        if shape != (self.header.action if self._actor is None else self._actor.space.label_size,):
            raise PolicyError(f"{str(path)!r} is damaged: its weights do not fit its actions")
        self._forget()

    def reset(self, observation: Any, info: Mapping[str, Any]) -> None:
        """Begin an episode."""
        self._forget()

    def _forget(self) -> None:
        if self._recovery is not None:
            self._recovery.reset()

    def act(self, observation: Any) -> np.ndarray:
        """Return the action, (A,) in [-1, 1], of an observation of mode `pointcloud`.

        It is float32, or float64 where commands become actions by inverse kinematics.

        Raises:
            ConfigError: an observation of other sizes.
        """
        arrays = self._layout.observe(observation)
        found = self._choose(arrays)
        return found if self._actor is None else self._actor.action(arrays.agent[0], found)

    def _choose(self, arrays: ObservationArrays) -> np.ndarray:
        """Return the action (A,), or command (V,), for a batch of one; as `choose` of the algorithms."""
        kinematics = None if self._actor is None else self._actor.kinematics
        seen = make_features(arrays, self._input, self._scale, self.header.frame, kinematics)
        features = self._networks[0].encode(seen)
        if self._actor is not None:
            return self._command(self._networks[0].head(features)[None], arrays.agent[0], self._actor)
        if self.header.algorithm != "bcq":
            return np.tanh(self._networks[0].head(features))
        candidates = np.tanh(self._networks[0].head(features, self._latents))  # (M, A)
        critic = self._networks[1]
        values = critic.head(critic.encode(seen), candidates)[:, 0]
        return candidates[values.argmax()]

    def _command(self, outputs: np.ndarray, agent: np.ndarray, actor: "CommandActor") -> np.ndarray:
        """Return the command (V,) that is carried out, of a network's outputs (1, `output_size`)."""
        if self._recovery is None:
            return actor.space.likeliest(outputs)[0]
        kind = self._recovery.choose(actor.space.logits(outputs)[0], actor.place_w(agent))
        return actor.space.of_kinds(outputs, np.array([kind]))[0]

    def _anything(self) -> ObservationArrays:
        """Return an observation of one cloud, whose points are all real and in every mask."""
        record = np.zeros(1, dtype=self._layout.dtype)
        record["codes"] = REAL | np.uint8((1 << self._layout.masks) - 1)
        return self._layout.decode(record)


def _read(path: Path) -> tuple[Header, dict[str, np.ndarray]]:
    """Return the header and the arrays of a policy file.

    Raises:
        PolicyError: as of `ArrayPolicy`.
    """
    try:
        with open_regular(path) as file:
            check_archive(file, _MOST_BYTES)
            with np.load(file, allow_pickle=False) as archive:
                values = {name: archive[name] for name in archive.files}
        given = parse_json(str(values.pop(_HEADER)))
    except FileNotFoundError as error:
        raise PolicyError(f"there is no policy file {str(path)!r}") from error
    except DAMAGED_ARCHIVE as error:
        reason = getattr(error, "strerror", None) or "it is no file of `artiskill export-policy`, or cut off"
        raise PolicyError(f"cannot read {str(path)!r}: {reason}") from error
    if not isinstance(given, dict) or given.pop("format", None) != FORMAT:
        raise PolicyError(f"{str(path)!r} is no file of `artiskill export-policy`")
    version = given.pop("version", None)
    if version != VERSION:
        raise PolicyError(
            f"{str(path)!r} is a policy file of version {shown(version)}; this version of artiskill reads "
            f"{VERSION}: use the version of artiskill that exported it, or export it anew"
        )
    try:
        header = from_mapping(Header, given, _HEADER)
    except ArtiSkillError as error:
        raise PolicyError(f"{str(path)!r} is damaged: {error}") from error
    for name, value in values.items():
        if value.dtype != np.float32 or not np.isfinite(value).all():
            raise PolicyError(f"{str(path)!r} is damaged: {shown(name)} holds something else than finite numbers")
    return header, values
