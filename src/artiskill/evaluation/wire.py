"""The wire: what passes between an evaluator and a policy's server, in the formats of openpi.

A message is a msgpack map. Arrays in it are maps with the keys `__ndarray__`, `data`, `dtype` and `shape`, scalars
of NumPy with `__npgeneric__`, as in openpi's `msgpack_numpy.py` (https://github.com/Physical-Intelligence/openpi).
What arrives was written by a stranger: it is checked, and nothing of it can be code.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from artiskill.config import check, check_inside, from_mapping, to_mapping
from artiskill.demos.lerobot import camera_names
from artiskill.envs.options import OBSERVATION_MODES
from artiskill.envs.wrappers import Sampling
from artiskill.errors import ArtiSkillError, MissingExtraError, shown
from artiskill.tasks.state_vector import robot_fields
from artiskill.tasks.task import Task

EXTRA = "remote"
VERSION = 1  # of `ServerMetadata`
API_KEY = "ARTISKILL_API_KEY"  # environment variable
MOST_BYTES = 64 * 2**20  # of a message; a full cloud has 3.5 MB
_MOST_ITEMS, _MOST_DIMENSIONS = 10_000, 8  # of a list or map that arrives, and of an array
_MOST_TEXT, _MOST_TRACEBACK = 300, 8000  # characters
MOST_STEPS = 100_000  # of an answer, that a server may want taken
_MOST_ARMS, _MOST_POINTS = 8, 1_000_000
_DTYPES = re.compile(r"[<>=|]?(b1|[iu][1248]|f[248])|bool|u?int(8|16|32|64)|float(16|32|64)")
_STATE, _OBJECT_STATE = "observation/state", "observation/environment_state"
# in the order of the environments, whose spaces sort their keys
_CLOUD = {"rgb": np.uint8, "seg": np.bool_, "xyz": np.float32}
_PICTURES = {"depth": ("depth", np.float32), "rgb": ("images", np.uint8), "seg": ("masks", np.bool_)}


class WireError(Exception):
    """What the other side does wrong, in one line.

    Args:
        text: the line.
        details: more of it, a traceback say.
    """

    def __init__(self, text: str, details: str = "") -> None:
        super().__init__(text)
        self.details = details


def import_msgpack() -> Any:
    """Return the library that packs messages.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        import msgpack
    except ImportError as error:
        raise MissingExtraError("a policy behind a WebSocket", EXTRA) from error
    return msgpack


def printable(text: str, most: int = _MOST_TRACEBACK) -> str:
    """Return a stranger's text without control characters but line ends, and not longer than this."""
    clean = "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in text[: most + 1])
    return clean if len(clean) <= most else f"{clean[: most - 3]}..."


def last_line(text: str) -> str:
    """Return the last line of a stranger's traceback, which says what was raised."""
    lines = [line for line in text[-_MOST_TRACEBACK:].splitlines() if line.strip()]
    return printable(lines[-1].strip(), _MOST_TEXT) if lines else "it does not say how"


# -- messages -----------------------------------------------------------------------------------------------------


def pack(message: Mapping[str, Any]) -> bytes:
    """Return a message as bytes; arrays may be of booleans, integers and floating-point numbers.

    Raises:
        TypeError: it holds something that has no place in a message.
    """
    packed: bytes = import_msgpack().packb(message, default=_encoded)
    return packed


def _encoded(value: Any) -> dict[bytes, Any]:
    if not isinstance(value, np.ndarray | np.generic) or not _DTYPES.fullmatch(value.dtype.str):
        raise TypeError(f"{type(value).__name__} cannot be sent")
    if isinstance(value, np.generic):
        return {b"__npgeneric__": True, b"data": value.item(), b"dtype": value.dtype.str}
    return {b"__ndarray__": True, b"data": value.tobytes(), b"dtype": value.dtype.str, b"shape": value.shape}


def unpack(data: bytes) -> dict[Any, Any]:
    """Return the message in bytes that arrived; its arrays may be written to.

    Raises:
        WireError: they are no message, or hold an array that is none.
    """
    msgpack = import_msgpack()
    limits = {"max_array_len": _MOST_ITEMS, "max_map_len": _MOST_ITEMS}
    try:
        found = msgpack.unpackb(data, object_hook=_decoded, **limits)
    except WireError:
        raise
    except Exception as error:  # of msgpack's own kinds, and whatever broken bytes lead to
        raise WireError(f"a message that is not msgpack ({type(error).__name__})") from error
    if not isinstance(found, dict):
        raise WireError(f"a message that is no map but {_kind(found)}")
    return found


def _kind(value: Any) -> str:
    return f"an array of shape {value.shape}" if isinstance(value, np.ndarray) else f"a {type(value).__name__}"


def _decoded(found: dict[Any, Any]) -> Any:
    """Return the array or scalar that a map stands for, any other map as it is; keys may be bytes or text."""
    for mark, decode in (("__ndarray__", _array), ("__npgeneric__", _scalar)):
        if mark in found or mark.encode() in found:
            parts = {key: found.get(key.encode(), found.get(key)) for key in ("data", "dtype", "shape")}
            return decode(parts["data"], _dtype(parts["dtype"]), parts["shape"])
    return found


def _dtype(given: Any) -> np.dtype[Any]:
    text = given.decode(errors="replace") if isinstance(given, bytes) else given
    if not isinstance(text, str) or not _DTYPES.fullmatch(text):
        raise WireError(f"an array of dtype {shown(given)}; legal are booleans, integers and floats")
    return np.dtype(text)


def _array(data: Any, dtype: np.dtype[Any], shape: Any) -> np.ndarray:
    is_shape = isinstance(shape, list) and len(shape) <= _MOST_DIMENSIONS and all(_is_count(n) for n in shape)
    if not is_shape or not isinstance(data, bytes):
        raise WireError(f"an array without data, or of shape {shown(shape)}")
    if math.prod(shape) * dtype.itemsize != len(data):
        raise WireError(f"an array of shape {tuple(shape)} and dtype {dtype.str} with {len(data)} bytes of data")
    return np.frombuffer(data, dtype).reshape(shape).astype(dtype.newbyteorder("="))


def _is_count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= MOST_BYTES


def _scalar(data: Any, dtype: np.dtype[Any], shape: Any) -> Any:
    wrong = f"a scalar of dtype {dtype.str} with the value {shown(data)}"
    if not isinstance(data, bool | int | float):
        raise WireError(wrong)
    try:
        return dtype.newbyteorder("=").type(data)
    except (ValueError, OverflowError) as error:
        raise WireError(wrong) from error


def plain(value: Any) -> Any:
    """Return a value of a message with NumPy's scalars and arrays as Python's numbers and lists."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list):
        return [plain(item) for item in value]
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


# -- what a server says of its policy -----------------------------------------------------------------------------


@dataclass(frozen=True)
class ServerMetadata:
    """What a server says of its policy when a client connects; all of it may be missing."""

    artiskill: int | None = None  # version of these keys
    task: str | None = None  # that it learned
    obs_mode: str | None = None  # of the observations that it needs
    control_mode: str | None = None  # of its actions
    points: int | None = None  # of a cloud; with none of the four, it gets the full one
    frame: str | None = None  # of the points
    method: str | None = None  # how they are chosen, see `Sampling`
    settings: dict[str, Any] | None = None  # of the method
    observation_config: dict[str, Any] | None = None  # values of `cameras`, `render` and `state` that it needs
    replan_steps: int | None = None  # how many actions of an answer are taken before it is asked again

    def __post_init__(self) -> None:
        version = VERSION if self.artiskill is None else self.artiskill
        check(version == VERSION, f"version {version} of our keys; this is version {VERSION}")
        for name, most in (("points", _MOST_POINTS), ("replan_steps", MOST_STEPS)):
            value = getattr(self, name)
            check_inside(name, 1 if value is None else value, (1, most))

    @property
    def sampling(self) -> dict[str, Any] | None:
        """The values of its `Sampling`; None for the full cloud."""
        given = {"num_points": self.points, "frame": self.frame, "method": self.method, "settings": self.settings}
        return {key: value for key, value in given.items() if value is not None} or None


def read_metadata(message: Mapping[Any, Any]) -> ServerMetadata:
    """Return our keys of a server's metadata; others are its own business.

    Raises:
        WireError: one of ours is illegal.
    """
    names = [field.name for field in fields(ServerMetadata)]
    given = {name: plain(message[name]) for name in names if message.get(name) is not None}
    try:
        return from_mapping(ServerMetadata, given, "its metadata")
    except ArtiSkillError as error:
        raise WireError(printable(str(error))) from error


def metadata_of(
    task: str | None,
    obs_mode: str,
    control_mode: str,
    sampling: Sampling | None,
    observation_config: Mapping[str, Any] | None,
) -> dict[str, Any]:
    """Return the metadata of a policy of ours, which answers with one action; as `ServerMetadata`."""
    found = {"artiskill": VERSION, "task": task, "obs_mode": obs_mode, "control_mode": control_mode}
    if sampling is not None:
        found |= {"points": sampling.num_points, "frame": sampling.frame, "method": sampling.method}
        found |= {"settings": to_mapping(sampling.settings)}
    found |= {"observation_config": to_mapping(observation_config) or None, "replan_steps": 1}
    return {key: value for key, value in found.items() if value is not None}


# -- observations -------------------------------------------------------------------------------------------------


class ObservationWriter:
    """Gives the observations of an environment the keys of the wire.

    Args:
        task: of the environment.
        obs_mode: of the environment.
    """

    def __init__(self, task: Task, obs_mode: str) -> None:
        self._obs_mode, self._cameras = obs_mode, camera_names(task.cameras.number)
        self._robot = robot_size(len(task.robot.mounts))

    def write(self, observation: Any) -> dict[str, Any]:
        """Return the part of a message that holds an observation."""
        if self._obs_mode == "state":
            return {_STATE: observation[-self._robot :], _OBJECT_STATE: observation[: -self._robot]}
        found = {_STATE: observation["agent"]}
        if self._obs_mode == "pointcloud":
            return found | {_cloud_key(name): observation["pointcloud"][name] for name in _CLOUD}
        for name, (key, _) in _PICTURES.items():
            parts = np.split(observation["rgbd"][name], len(self._cameras), axis=2)
            for camera, part in zip(self._cameras, parts, strict=True):
                found[f"observation/{key}/{camera}"] = part[..., 0] if name == "depth" else part
        return found


def read_observation(message: Mapping[Any, Any], obs_mode: str) -> Any:
    """Return the observation in a message, as an environment of the mode would give it.

    Raises:
        WireError: a part of it is missing, or of a shape that no observation has.
    """
    assert obs_mode in OBSERVATION_MODES
    state = _taken(message, _STATE, np.float32, 1)
    if obs_mode == "state":
        return np.concatenate([_taken(message, _OBJECT_STATE, np.float32, 1), state])
    if obs_mode == "pointcloud":
        cloud = {name: _taken(message, _cloud_key(name), dtype, 2) for name, dtype in _CLOUD.items()}
        return {"agent": state, "pointcloud": cloud}
    number = sum(isinstance(key, str) and key.startswith("observation/images/") for key in message)
    names, pictures = camera_names(number), {}
    for name, (key, dtype) in _PICTURES.items():
        parts = [_taken(message, f"observation/{key}/{one}", dtype, 3 - (name == "depth")) for one in names]
        if not parts or len({part.shape for part in parts}) > 1:
            raise WireError(f"no pictures observation/{key}/..., or of different sizes")
        pictures[name] = np.stack(parts, axis=2) if name == "depth" else np.concatenate(parts, axis=2)
    return {"agent": state, "rgbd": pictures}


def _cloud_key(name: str) -> str:
    return f"observation/pointcloud/{name}"


def _taken(message: Mapping[Any, Any], key: str, dtype: Any, dimensions: int) -> np.ndarray:
    value = message.get(key)
    if not isinstance(value, np.ndarray) or value.ndim != dimensions:
        found = "none" if value is None else _kind(value)
        raise WireError(f"an observation needs {key!r}, an array of {dimensions} dimensions; there is {found}")
    return value.astype(dtype, copy=False)


def robot_size(arms: int) -> int:
    """Return how many numbers the robot's part of the state has."""
    return sum(field.size for field in robot_fields(arms))


def action_size(message: Mapping[Any, Any]) -> int:
    """Return how many numbers an action has, by the robot's part of an observation.

    Raises:
        WireError: no robot has such a state.
    """
    size = len(_taken(message, _STATE, np.float32, 1))
    arms = {robot_size(count): count for count in range(1, _MOST_ARMS + 1)}
    if size not in arms:
        raise WireError(f"{_STATE!r} has {size} numbers; with one arm it has {robot_size(1)}, with two more")
    return 4 + 9 * arms[size]  # base, lift, and nine for each arm, see `Control`


def read_actions(message: Mapping[Any, Any], size: int) -> np.ndarray:
    """Return the actions of an answer, (H, size) float64 and finite; a server may send (size,), too.

    Raises:
        WireError: there are none, or others.
    """
    legal = f"an action is {size} finite numbers in [-1, 1]"
    if "actions" not in message:
        keys: Sequence[Any] = sorted(map(str, message))
        raise WireError(f"an answer without 'actions' (it has {shown(keys)})")
    given = message["actions"]
    try:
        array = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise WireError(f"'actions' that are {_kind(given)}, not numbers; {legal}") from error
    rows = array[None] if array.ndim == 1 else array
    if rows.ndim != 2 or rows.shape[1] != size or not len(rows):
        raise WireError(f"actions of shape {array.shape}; {legal}, or H rows of them")
    if not np.isfinite(rows).all():
        row, entry = np.argwhere(~np.isfinite(rows))[0].tolist()
        raise WireError(f"actions with {rows[row, entry]} in row {row}, entry {entry}; {legal}")
    return rows
