"""What passes between evaluator and server: bytes, keys, and what of a stranger's bytes is refused."""

import struct
from typing import Any

import msgpack
import numpy as np
import pytest

from artiskill.envs.manipulation import ManipulationEnv
from artiskill.evaluation.wire import (
    ObservationWriter,
    ServerMetadata,
    WireError,
    action_size,
    last_line,
    metadata_of,
    pack,
    read_actions,
    read_metadata,
    read_observation,
    unpack,
)
from artiskill.tasks.registry import task_names

ARRAYS = [
    np.arange(6, dtype=np.float32).reshape(2, 3),
    np.array([[True, False]]),
    np.arange(4, dtype=np.uint8)[::2],
    np.zeros((0, 13)),
    np.array(3.5),
    np.array([1, -2], dtype=np.int64),
    np.array([0.5], dtype=np.float16),
]


def array_map(data: Any = bytes(8), dtype: Any = "<f4", shape: Any = (2,), mark: Any = b"__ndarray__") -> bytes:
    keys = (b"data", b"dtype", b"shape") if isinstance(mark, bytes) else ("data", "dtype", "shape")
    found: bytes = msgpack.packb({"actions": {mark: True} | dict(zip(keys, (data, dtype, shape), strict=True))})
    return found


@pytest.mark.parametrize("array", ARRAYS, ids=lambda array: f"{array.dtype}{array.shape}")
def test_arrays_survive(array: np.ndarray) -> None:
    again = unpack(pack({"a": {"b": array}}))["a"]["b"]
    assert again.dtype == array.dtype
    assert again.shape == array.shape
    assert again.tobytes() == array.tobytes()
    again[...] = 0  # may be written to


def test_other_values_survive() -> None:
    message = {"reset": True, "step": 7, "prompt": "Öffne!", "list": [1, 2.5, None], "s": np.float32(0.1)}
    assert unpack(pack(message)) == message
    with pytest.raises(TypeError, match="object cannot be sent"):
        pack({"a": object()})
    with pytest.raises(TypeError, match="ndarray cannot be sent"):
        pack({"a": np.array([None])})


def test_the_bytes_are_those_of_openpi() -> None:
    """Put together by hand from msgpack's specification: fixmap, bin 8, true, fixstr, fixarray."""
    expected = (
        b"\x81\xa1a\x84\xc4\x0b__ndarray__\xc3\xc4\x04data\xc4\x08" + struct.pack("<2f", 1.0, 2.0)
        + b"\xc4\x05dtype\xa3<f4\xc4\x05shape\x91\x02"
    )  # fmt: skip
    assert pack({"a": np.array([1, 2], dtype="<f4")}) == expected
    scalar = b"\x81\xa1a\x83\xc4\x0d__npgeneric__\xc3\xc4\x04data\x05\xc4\x05dtype\xa3<i8"
    assert pack({"a": np.int64(5)}) == scalar
    assert unpack(scalar) == {"a": 5}


def test_keys_may_be_text_and_bytes_of_either_order() -> None:
    values = np.array([1.5, -2.0])
    for mark in (b"__ndarray__", "__ndarray__"):
        found = unpack(array_map(values.astype(">f8").tobytes(), ">f8", (2,), mark))["actions"]
        assert found.tolist() == [1.5, -2.0]
        assert found.dtype == np.float64


REFUSED = {
    "text": (b"hello", r"not msgpack \(ExtraData\)"),
    "empty": (b"", "not msgpack"),
    "cut": (pack({"actions": np.zeros(13)})[:-3], "not msgpack"),
    "number": (msgpack.packb(5), "no map but a int"),
    "array": (pack(np.zeros(3)), r"no map but an array of shape \(3,\)"),  # type: ignore[arg-type]
    "object": (array_map(dtype="|O"), r"dtype '\|O'; legal are booleans, integers and floats"),
    "pickle": (array_map(dtype="O"), "dtype 'O'"),
    "void": (array_map(dtype="|V8"), "dtype"),
    "record": (array_map(dtype="f4,f4"), "dtype"),
    "complex": (array_map(dtype="<c8", shape=(1,)), "dtype"),
    "long": (array_map(dtype="<f16"), "dtype"),
    "text_dtype": (array_map(dtype="<U2", shape=(1,)), "dtype"),
    "time": (array_map(dtype="<M8[s]", shape=(1,)), "dtype"),
    "list_dtype": (array_map(dtype=[["a", "<f4"]]), "dtype"),
    "no_dtype": (array_map(dtype=None), "dtype None"),
    "too_few": (array_map(shape=(3,)), r"shape \(3,\) and dtype <f4 with 8 bytes"),
    "too_many": (array_map(shape=(1,)), r"shape \(1,\) and dtype <f4 with 8 bytes"),
    "negative": (array_map(shape=(-2,)), r"of shape \[-2\]"),
    "two_negative": (array_map(shape=(-1, -2)), "of shape"),
    "huge": (array_map(shape=(2**62, 4)), "of shape"),
    "overflow": (array_map(data=b"", shape=(2**26, 2**26, 2**26)), "with 0 bytes"),
    "float_shape": (array_map(shape=(2.0,)), "of shape"),
    "bool_shape": (array_map(shape=(True, 2)), "of shape"),
    "deep_shape": (array_map(shape=(1,) * 9), "of shape"),
    "no_shape": (array_map(shape=None), "of shape None"),
    "no_data": (array_map(data=None), "without data"),
    "text_data": (array_map(data="12345678"), "without data"),
    "scalar": (msgpack.packb({"a": {"__npgeneric__": True, "data": "x", "dtype": "<f4"}}), "scalar of dtype"),
    "scalar_range": (msgpack.packb({"a": {"__npgeneric__": True, "data": 300, "dtype": "|i1"}}), "scalar"),
    "many": (b"\xdd\x00\xff\xff\xff" + bytes(20), "not msgpack"),
    "deep": (b"\x91" * 5000 + b"\x00", "not msgpack"),
    "utf8": (b"\x81\xa1a\xa1\xff", "not msgpack"),
    "keys": (b"\x81\x01\x02", "not msgpack"),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_what_is_refused(kind: str) -> None:
    data, says = REFUSED[kind]
    with pytest.raises(WireError, match=says):
        unpack(data)


def test_broken_bytes_are_refused_or_read() -> None:
    """Anything that is not refused is a map: no other error, whatever comes."""
    generator = np.random.default_rng(0)
    whole = pack({"actions": np.zeros((2, 13), np.float32), "server_timing": {"infer_ms": np.float32(1)}})
    refused = 0
    for _ in range(3000):
        data = bytearray(whole)
        for place in generator.integers(len(data), size=generator.integers(1, 4)):
            data[place] = generator.integers(256)
        try:
            assert isinstance(unpack(bytes(data)), dict)
        except WireError:
            refused += 1
    assert refused > 100


# -- actions ------------------------------------------------------------------------------------------------------


def test_actions_are_rows() -> None:
    assert read_actions({"actions": np.zeros(13, np.float32)}, 13).shape == (1, 13)
    assert read_actions({"actions": np.ones((4, 13), np.int64)}, 13).tolist() == np.ones((4, 13)).tolist()
    assert read_actions({"actions": [[0] * 13, [0.5] * 13]}, 13).dtype == np.float64


BAD_ACTIONS = {
    "none": ({"action": 1, "x": 2}, r"an answer without 'actions' \(it has \['action', 'x'\]\)"),
    "short": ({"actions": np.zeros(12)}, r"shape \(12,\); an action is 13 finite numbers in \[-1, 1\]"),
    "empty": ({"actions": np.zeros((0, 13))}, r"shape \(0, 13\)"),
    "deep": ({"actions": np.zeros((1, 2, 13))}, r"shape \(1, 2, 13\)"),
    "number": ({"actions": 0.5}, r"shape \(\)"),
    "null": ({"actions": None}, r"shape \(\)"),
    "nan": ({"actions": np.array([[0.0] * 13, [0.0] * 12 + [np.nan]])}, "nan in row 1, entry 12"),
    "inf": ({"actions": np.full(13, -np.inf)}, "-inf in row 0, entry 0"),
    "text": ({"actions": "left"}, "'actions' that are a str, not numbers"),
    "map": ({"actions": {"arm": 1}}, "'actions' that are a dict, not numbers"),
    "ragged": ({"actions": [[0.0], [0.0, 1.0]]}, "not numbers"),
}


@pytest.mark.parametrize("kind", BAD_ACTIONS)
def test_what_is_no_action(kind: str) -> None:
    message, says = BAD_ACTIONS[kind]
    with pytest.raises(WireError, match=says):
        read_actions(message, 13)


# -- observations -------------------------------------------------------------------------------------------------

CAMERAS = {"cameras.width": 24, "cameras.height": 16}


def flat(observation: Any) -> list[tuple[str, tuple[int, ...], bytes]]:
    if isinstance(observation, dict):
        return [(f"{key}/{name}", *rest) for key in observation for name, *rest in flat(observation[key])]
    return [(str(observation.dtype), observation.shape, observation.tobytes())]


@pytest.mark.parametrize("task", ["OpenCabinetDrawer", "MoveBucket"])
@pytest.mark.parametrize("obs_mode", ["state", "pointcloud", "rgbd"])
@pytest.mark.parametrize("number", [1, 3])
def test_an_observation_arrives_as_it_was(task: str, obs_mode: str, number: int) -> None:
    env = ManipulationEnv(task, obs_mode=obs_mode, config=CAMERAS | {"cameras.number": number})
    observation, info = env.reset(seed=3)
    message = unpack(pack(ObservationWriter(env.task, obs_mode).write(observation)))
    assert flat(read_observation(message, obs_mode)) == flat(observation)
    assert action_size(message) == env.action_space.shape[0]
    text = repr(list(message))
    assert info["object"] not in text
    assert info["target"] not in text


def test_keys_of_pictures() -> None:
    env = ManipulationEnv("OpenCabinetDrawer", obs_mode="rgbd", config=CAMERAS)
    observation, _ = env.reset(seed=3)
    message = ObservationWriter(env.task, "rgbd").write(observation)
    sides = ("front", "left", "right")
    keys = {f"observation/{kind}/{side}" for kind in ("images", "depth", "masks") for side in sides}
    assert message.keys() == keys | {"observation/state"}
    assert message["observation/images/left"].shape == (16, 24, 3)
    np.testing.assert_array_equal(message["observation/images/left"], observation["rgbd"]["rgb"][..., 3:6])
    np.testing.assert_array_equal(message["observation/depth/right"], observation["rgbd"]["depth"][..., 2])
    np.testing.assert_array_equal(message["observation/masks/front"], observation["rgbd"]["seg"][..., 0:3])


@pytest.mark.parametrize(
    ("message", "mode", "says"),
    [
        ({}, "pointcloud", "needs 'observation/state', an array of 1 dimensions; there is none"),
        ({"observation/state": [1.0]}, "pointcloud", "there is a list"),
        ({"observation/state": np.zeros((2, 2))}, "pointcloud", r"there is an array of shape \(2, 2\)"),
        ({"observation/state": np.zeros(38)}, "pointcloud", "needs 'observation/pointcloud/rgb'"),
        ({"observation/state": np.zeros(38)}, "rgbd", "no pictures"),
        ({"observation/state": np.zeros(38), "observation/images/a": 1}, "rgbd", "observation/depth/camera_0"),
    ],
)
def test_what_is_no_observation(message: dict[str, Any], mode: str, says: str) -> None:
    with pytest.raises(WireError, match=says):
        read_observation(message, mode)


def test_a_robot_that_nobody_knows() -> None:
    with pytest.raises(WireError, match=r"'observation/state' has 40 numbers; with one arm it has 38"):
        action_size({"observation/state": np.zeros(40)})


# -- metadata -----------------------------------------------------------------------------------------------------


def test_metadata_may_be_empty_or_of_others() -> None:
    assert read_metadata({}) == ServerMetadata()
    assert read_metadata({"reset_pose": np.zeros(7), 5: 6, "points": None}) == ServerMetadata()
    said = read_metadata({"points": np.int64(64), "observation_config": {"cameras.width": np.int64(8)}})
    assert said == ServerMetadata(points=64, observation_config={"cameras.width": 8})


def test_our_own_metadata_come_back() -> None:
    found = metadata_of("PushChair", "state", "joint", None, {})
    assert found == {
        "artiskill": 1,
        "task": "PushChair",
        "obs_mode": "state",
        "control_mode": "joint",
        "replan_steps": 1,
    }
    assert read_metadata(unpack(pack(found))).task in task_names()


@pytest.mark.parametrize(
    ("metadata", "says"),
    [
        ({"artiskill": 2}, "version 2 of our keys; this is version 1"),
        ({"points": "64"}, "points"),
        ({"points": 0}, r"points must lie in \[1, 1000000\], not 0"),
        ({"points": 10**9}, "points must lie"),
        ({"replan_steps": 0}, "replan_steps must lie"),
        ({"obs_mode": ["state"]}, "obs_mode"),
        ({"observation_config": "wide\x1b[31m"}, "observation_config"),
    ],
)
def test_illegal_metadata(metadata: dict[str, Any], says: str) -> None:
    with pytest.raises(WireError, match=f"its metadata: .*{says}") as caught:
        read_metadata(metadata)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("Traceback ...\n  File x\nKeyError: 'a'\n\n", "KeyError: 'a'"),
        ("", "it does not say how"),
        ("one\x1b[2Jline", r"one\x1b[2Jline"),
        ("x" * 10**6, "x" * 297 + "..."),
    ],
)
def test_a_traceback_becomes_a_line(text: str, says: str) -> None:
    assert last_line(text) == says
