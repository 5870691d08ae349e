"""Hostile inputs at every entry point: each ends soon, with one clear error of ours or a legal result.

Paths stay in a folder of the test, and a link stands for a device: a fault here must not harm the machine.
"""

import contextlib
import io
import itertools
import json
import os
import resource
import signal
import zipfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import artiskill
from artiskill.assets.catalog import list_objects, load_object, resolve_objects
from artiskill.cli.main import EXIT_ERROR, main
from artiskill.demos.demo_file import DemoFile
from artiskill.demos.demos import PACK, Demos, find_folders
from artiskill.demos.stats import folder_stats
from artiskill.demos.training_file import TrainingFile, TrainingFiles
from artiskill.demos.verify import verify
from artiskill.errors import ArtiSkillError
from artiskill.evaluation.pictures import check_picture, save_object_picture, write_picture
from artiskill.evaluation.recording import check_video
from artiskill.exports.export import export_object
from artiskill.robots.config import load_robot
from artiskill.sensors.camera import Camera
from artiskill.sensors.render_config import load_render_config
from artiskill.tasks.registry import make_task

LIMIT_S = 20  # of the clock, on a busy machine; a hang is longer
MOST_MESSAGE = 2500  # characters
EXTRA_BYTES = 6 << 30  # of address space beside what is in use: more is asked for by mistake only


class Hang(BaseException):
    """An input that takes too long."""


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working directory, with what is there to trip over."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("PARTNET_MOBILITY_DATASET", raising=False)
    for suffix in ("", ".yaml", ".py", ".zip", ".png", ".gif", ".json", ".h5"):
        os.mkfifo(f"pipe{suffix}")
        os.symlink("/dev/zero", f"device{suffix}")
        Path(f"garbage{suffix}").write_bytes(bytes(range(256)) * 4)
    Path("deep.yaml").write_text("objects: " + "[" * 5000)
    return tmp_path


@pytest.fixture(autouse=True)
def bounds() -> Iterator[None]:
    """A limit on memory, and the alarm of `ends_well`."""

    def ring(*_: Any) -> None:
        raise Hang

    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    before, handler = resource.getrlimit(resource.RLIMIT_AS), signal.signal(signal.SIGALRM, ring)
    resource.setrlimit(resource.RLIMIT_AS, (used + EXTRA_BYTES, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_AS, before)
    signal.signal(signal.SIGALRM, handler)


@contextlib.contextmanager
def in_time(what: str) -> Iterator[None]:
    signal.alarm(LIMIT_S)
    try:
        yield
    except Hang:
        pytest.fail(f"{what} takes too long")
    finally:
        signal.alarm(0)


def check_call(what: str, call: Callable[[], object]) -> str:
    """Call it; the message of our error, or an empty text after a legal result."""
    with in_time(what):
        try:
            call()
        except ArtiSkillError as error:
            message = str(error)
        else:
            return ""
    assert 10 < len(message) <= MOST_MESSAGE, f"{what}: {message!r}"
    return message


def check_command(argv: list[str]) -> None:
    """Run a command line in this process; an error is one line, whatever came before it."""
    what = f"artiskill {' '.join(argv)!r:.200}"
    out = io.TextIOWrapper(io.BytesIO(), encoding="utf-8")  # strict, as a terminal is
    err = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", errors="backslashreplace")
    with in_time(what), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = main(argv)
    err.flush()
    said = err.buffer.getvalue().decode()  # type: ignore[attr-defined]
    if status == EXIT_ERROR:
        (line,) = [line for line in said.splitlines() if line.startswith("error: ")]
        assert len(line) <= MOST_MESSAGE, what
        assert said.endswith(line + "\n"), what
    assert status in (0, 1, EXIT_ERROR), what


LONG, HUGE = "x" * 300, "x" * 100_000
NAMES = (
    *("", " ", "a\0b", LONG, HUGE, "\ud800", "a\udcff", "[/bold][red", "./a\0b/c", f"./{LONG}/c", "./\ud800/c"),
    "/".join(["d"] * 3000),
)
OBJECTS = (
    *NAMES,
    *(f"{name}{suffix}" for name in ("pipe", "device", "garbage") for suffix in (".yaml", ".zip")),
    *("./pipe", "./device", "./garbage", "deep.yaml", f"{LONG}.yaml", "a\0.yaml", f"{LONG}.zip", "\ud800.zip"),
    *("generated:cabinet:0..99999999999", f"generated:cabinet:{'9' * 5000}", f"generated:chair:{'9' * 400}"),
    *("partnet:a\0b", f"partnet:{'x' * 5000}", "partnet:/etc", "partnet:\ud800"),
)
POLICIES = (*NAMES, "pipe.py", "device.py", "garbage.py", f"{LONG}.py", "a\0.py", "\ud800.py")
# a place in which nothing can be written, whoever asks
PLACES = (*NAMES[:-6], "pipe/in", "device/in", "pipe", "device", f"./{LONG}/c", "/".join(["d"] * 3000))
PICTURES = (
    *NAMES,
    "pipe.png",
    "device.png",
    "device.gif",
    f"{LONG}.png",
    "a\0.png",
    "\ud800.png",
    "pipe.png/a.png",
)
INTEGERS = ("-1", "9" * 400, "9" * 5000, "nan", "1e9", "", "0x10")
NUMBERS = ("nan", "inf", "-inf", "1e400", "9" * 5000, "")
DEEP = "[" * 5000
LAUGHS = (
    "[&a [1,1,1,1,1,1,1,1,1],"
    + ",".join(f"&{b} [{','.join([f'*{a}'] * 9)}]" for a, b in zip("abcdefghi", "bcdefghij", strict=True))
    + "]"
)
VALUES = (
    *(
        "9" * 400,
        "9" * 5000,
        str(10**30),
        "nan",
        ".inf",
        "1e999",
        DEEP,
        "{a: " * 3000,
        "&a [*a]",
        LAUGHS,
        "\ud800",
        "\0",
    ),
    *(
        "!!timestamp x",
        "!!bool x",
        "!!int ''",
        "2001-99-99",
        "1:" * 50_000 + "1",
        f"'{HUGE}'",
        "-1",
        "1e-300",
        "[]",
        "{}",
    ),
)
PAIRS = ("=", "a", "a=", f"{HUGE}=1", "a." * 4000 + "=1", "\0=1", "\ud800=1", "a.b.c=1")

PACKED = str(PACK / "OpenCabinetDrawer")
STILL = ["--policy", "still"]
# command -> a line that would be legal but for one thing that is looked at last, and the places for hostile words
COMMANDS: dict[str, tuple[list[str], dict[str, tuple[str, ...]]]] = {
    "evaluate": (
        ["evaluate", "--objects", "cabinet-0001", "--episodes", "1", "--workers", "0", *STILL],
        {
            **{
                "--task": NAMES,
                "--policy": POLICIES,
                "--objects": OBJECTS,
                "--target": NAMES,
                "--episodes": INTEGERS,
            },
            **{"--first-level": INTEGERS, "--obs-mode": NAMES, "--control-mode": NAMES, "--step-timeout": NUMBERS},
            **{"--out": PLACES, "--video": PICTURES, "--video-episodes": INTEGERS, "--workers": INTEGERS},
        },
    ),
    "render": (
        ["render", "--object", "cabinet-0001", "--open", "2", "--out", "o.png"],
        {
            **{"--object": OBJECTS, "--out": PICTURES, "--width": ("30000", *INTEGERS), "--height": INTEGERS},
            **{"--azimuth": NUMBERS, "--elevation": NUMBERS, "--distance": ("1e308", *NUMBERS), "--open": NUMBERS},
        },
    ),
    "render an episode": (
        ["render", "--task", "OpenCabinetDrawer", "--object", "cabinet-0001", "--level", "-1", "--out", "o.png"],
        {
            "--task": NAMES,
            "--target": NAMES,
            "--level": INTEGERS,
            "--policy": POLICIES,
            "--view": NAMES,
            "--step": INTEGERS,
        },
    ),
    "objects": (["objects"], {"--task": NAMES, "--category": NAMES, "--split": NAMES}),
    "config": (["config", "show", "PushChair"], {"@2": NAMES}),
    "check": (
        ["assets", "check", "cabinet-0001", "--workers", "0"],
        {"@2": OBJECTS, "--json": PLACES, "--workers": INTEGERS},
    ),
    "export": (
        ["assets", "export", "bucket-0001", "--format", "urdf", "--out", "e"],
        {"@2": OBJECTS, "--format": NAMES, "--out": PLACES},
    ),
    "gallery": (["assets", "gallery", "bucket-0001", "--out", "pipe/in"], {"@2": OBJECTS, "--out": PLACES}),
    "solve": (
        ["assets", "solve", "cabinet-0001", "--task", "OpenCabinetDrawer", "--threads", "0"],
        {"@2": OBJECTS, "--task": NAMES, "--levels": INTEGERS, "--threads": ("-1", "nan", "9" * 5000)},
    ),
    "collect": (
        ["demos", "collect", "--task", "PushChair", "--objects", "chair-0001", "--per-object", "0", "--out", "c"],
        {
            **{"--task": NAMES, "--objects": OBJECTS, "--per-object": INTEGERS, "--per-target": INTEGERS},
            **{"--targets": NAMES, "--control-mode": NAMES, "--first-level": INTEGERS, "--out": PLACES},
            **{"--ray": (*NAMES, f"a:{'9' * 5000}")},
        },
    ),
    "verify": (
        ["demos", "verify", "pipe"],
        {"@2": (*NAMES, "device", "garbage", "pipe.h5"), "--objects": OBJECTS},
    ),
    "stats": (["demos", "stats", "pipe"], {"@2": (*NAMES, "device", "garbage")}),
    "replay": (
        ["demos", "replay", PACKED, "--out", "r", "--obs-mode", "state", "--count", "0"],
        {
            **{"@2": NAMES, "--out": PLACES, "--obs-mode": NAMES, "--points": INTEGERS, "--method": NAMES},
            **{"--frame": NAMES, "--control-mode": NAMES, "--objects": OBJECTS, "--compression": INTEGERS},
        },
    ),
    "export of demos": (
        ["demos", "export", "pipe", "--format", "minari", "--out", "x"],
        {"@2": (*NAMES, "device"), "--format": NAMES, "--out": PLACES, "--name": NAMES},
    ),
    "pictures": (
        ["demos", "pictures", PACKED, "--object", "nobody", "--out", "p.png"],
        {
            "@2": NAMES,
            "--object": OBJECTS,
            "--out": PICTURES,
            "--count": INTEGERS,
            "--width": ("30000", *INTEGERS),
        },
    ),
    "bench": (
        ["bench", "--objects", "cabinet-0001", "--task", "OpenCabinetDrawer", "--num-envs", "0"],
        {
            "--task": NAMES,
            "--obs": NAMES,
            "--num-envs": INTEGERS,
            "--threads": INTEGERS,
            "--objects": OBJECTS,
            "--seconds": NUMBERS,
        },
    ),
}
SLOTS = [(command, slot) for command, (_, slots) in COMMANDS.items() for slot in slots]


@pytest.mark.parametrize(("command", "slot"), SLOTS, ids=[f"{command} {slot}" for command, slot in SLOTS])
def test_words_of_a_command_line(command: str, slot: str) -> None:
    base, slots = COMMANDS[command]
    for word in slots[slot]:
        argv = list(base)
        if slot.startswith("@"):
            argv[int(slot[1:])] = word
        else:
            argv += [f"{slot}={word}"]
        check_command(argv)


SET = {
    "config show": ["config", "show", "OpenCabinetDrawer", "--set"],
    "evaluate": ["evaluate", "--objects", "cabinet-0001", *STILL, "--workers", "0", "--set"],
    "check": ["assets", "check", "cabinet-0001", "--workers", "0", "--set"],
    "solve": ["assets", "solve", "cabinet-0001", "--task", "OpenCabinetDrawer", "--threads", "0", "--set"],
    "look": ["render", "--object", "cabinet-0001", "--open", "2", "--out", "o.png", "--look"],
}


@pytest.mark.parametrize("base", SET.values(), ids=SET)
def test_settings_of_a_command_line(base: list[str]) -> None:
    for pair in (*PAIRS, *(f"episode_steps={value}" for value in VALUES)):
        check_command([*base, pair])


class Evil:
    """What raises whatever it is asked."""

    def __getattr__(self, name: str) -> Any:
        raise RuntimeError("no")

    def __repr__(self) -> str:
        raise RuntimeError("no")


def nested(depth: int) -> Any:
    found: Any = 1
    for _ in range(depth):
        found = {"a": found}
    return found


def circle() -> dict[str, Any]:
    found: dict[str, Any] = {}
    found["physics"] = found
    return found


THINGS: tuple[Any, ...] = (
    *(
        Evil(),
        [Evil()],
        object(),
        10**5000,
        -1,
        0,
        True,
        float("nan"),
        float("inf"),
        b"abc",
        HUGE,
        "\ud800",
        "a\0b",
    ),
    *(
        np.zeros(3),
        np.array(["a"]),
        {"a": Evil()},
        [],
        {},
        [[[]]],
        range(10**12),
        nested(2000),
        circle(),
        type,
        len,
    ),
)
KEYWORDS = ("objects", "target", "obs_mode", "reward_mode", "control_mode", "render_mode", "config")


@pytest.mark.parametrize("keyword", [*KEYWORDS, "task"])
@pytest.mark.parametrize("name", ["ManipulationEnv", "ManipulationVectorEnv"])
def test_arguments_of_environments(keyword: str, name: str) -> None:
    for thing in THINGS:
        check_call(
            f"{name}({keyword}={type(thing).__name__})",
            lambda thing=thing: getattr(artiskill, name)(**{keyword: thing}),
        )


@pytest.mark.parametrize("keyword", ["num_envs", "num_threads", "env_objects", "autoreset_mode"])
def test_arguments_of_vectors(keyword: str) -> None:
    for thing in (*THINGS, 10**9, 10**30):
        check_call(keyword, lambda thing=thing: artiskill.ManipulationVectorEnv(**{keyword: thing}))


def test_arguments_of_gymnasium_make() -> None:
    for keyword, thing in itertools.product(
        ("objects", "config", "obs_mode", "target"), (Evil(), 10**5000, HUGE, circle())
    ):
        check_call(keyword, partial(gym.make, "ArtiSkill/OpenCabinetDrawer-v0", **{keyword: thing}))


def test_arguments_of_an_environment() -> None:
    env = artiskill.ManipulationEnv(objects="cabinet-0001")
    env.reset(seed=0)
    for thing in THINGS:
        assert check_call("step", partial(env.step, thing))
        assert check_call("restore_state", partial(env.restore_state, thing))
        check_call("reset", partial(env.reset, options=thing))
        for option in ("level", "object", "target"):
            check_call(option, partial(env.reset, options={option: thing}))


# every number of a configuration that sizes or counts something
SIZES = (
    *("episode_steps", "max_object_joints", "cameras.number", "cameras.width", "cameras.height"),
    *("physics.timestep_s", "physics.physics_steps_per_control", "physics.control_steps_per_step"),
    *("physics.solver_iterations", "physics.line_search_iterations", "physics.noslip_iterations"),
    *("physics.contact.impratio", "physics.gravity_m_s2", "render.max_texture_px", "render.samples_per_axis"),
    *("render.shadows.resolution", "render.occlusion.resolution", "success.open_fraction", "success.hold_s"),
)
AMOUNTS = (
    10**400,
    10**30,
    2**63,
    10**12,
    -1,
    0,
    1e308,
    float("nan"),
    float("inf"),
    -float("inf"),
    "9" * 5000,
    True,
    None,
    [],
    {},
)


@pytest.mark.parametrize("key", SIZES)
def test_sizes_in_a_configuration(key: str) -> None:
    for amount in AMOUNTS:
        check_call(f"{key}={amount!s:.20}", lambda amount=amount: make_task("OpenCabinetDrawer", {key: amount}))
        check_call(f"{key}={amount!s:.20}", lambda amount=amount: load_render_config("picture", {key: amount}))


def test_robots() -> None:
    for given in (
        *THINGS,
        *OBJECTS,
        "pipe.yaml",
        "device.yaml",
        "garbage.yaml",
        {"like": "pipe.yaml"},
        {"like": Evil()},
    ):
        assert check_call("load_robot", lambda given=given: load_robot(given))
        check_call("config", lambda given=given: make_task("PushChair", {"robot": given}))


READERS: dict[str, Callable[[Any], object]] = {
    "load_object": load_object,
    "load_object of a path": lambda given: load_object(Path(given)),
    "resolve_objects": resolve_objects,
    "list_objects": lambda given: list_objects(category=given),
    "import_partnet": artiskill.import_partnet,
    "Demos": Demos,
    "DemoFile": DemoFile,
    "TrainingFile": TrainingFile,
    "TrainingFiles": TrainingFiles,
    "find_folders": find_folders,
    "folder_stats": folder_stats,
    "verify": verify,
    "load_demo_pack": artiskill.load_demo_pack,
    "evaluate": lambda given: artiskill.evaluate("OpenCabinetDrawer", given, "cabinet-0001", episodes=0),
}


@pytest.mark.parametrize("name", READERS)
def test_what_is_read_by_name(name: str) -> None:
    for given in dict.fromkeys(
        (*OBJECTS, *POLICIES, "pipe", "device", "garbage", "pipe.h5", "device.h5", "garbage.h5")
    ):
        if name.endswith("of a path") and not given.strip():
            continue  # the working directory
        assert check_call(f"{name}({given!r:.40})", lambda given=given: READERS[name](given))
    if not name.endswith("of a path"):
        for thing in THINGS:
            if not (name == "resolve_objects" and isinstance(thing, range)):
                check_call(f"{name}({type(thing).__name__})", lambda thing=thing: READERS[name](thing))


WRITERS: dict[str, Callable[[Any], object]] = {
    "check_picture": check_picture,
    "check_video": check_video,
    "write_picture": lambda given: write_picture(given, np.zeros((4, 4, 3), np.uint8)),
    "export_object": lambda given: export_object(load_object("bucket-0001"), "urdf", given),
}


@pytest.mark.parametrize("name", WRITERS)
def test_what_is_written_by_name(name: str, place: Path) -> None:
    links = {path: os.lstat(path).st_mode for path in place.iterdir()}
    wrong = [name for name in PICTURES if name.strip()] if name != "export_object" else PLACES[2:]
    for given in (*(w for w in wrong if w not in ("[/bold][red", "a\udcff", HUGE)), Evil(), 3, None):
        assert check_call(
            f"{name}({given!r:.40})" if not isinstance(given, Evil) else name,
            lambda given=given: WRITERS[name](given),
        )
    assert {path: os.lstat(path).st_mode for path in links} == links


def test_large_pictures() -> None:
    for width, height in ((30_000, 30_000), (10**9, 1), (10**30, 10**30), (0, 1), (-1, 5)):
        assert check_call(
            "picture", partial(save_object_picture, "a.png", "bucket-0001", width=width, height=height)
        )
        assert check_call("camera", partial(Camera, np.zeros(3), np.eye(3), width, height))


META = '{"model_cat": "StorageFurniture"}'
MESH = '<visual><geometry><mesh filename="a.obj"/></geometry></visual>'
URDF = f'<robot name="a"><link name="base">{MESH}</link></robot>'
CORNERS = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
FOLDERS: dict[str, dict[str, str | bytes]] = {
    "deep meta": {"meta.json": "[" * 10**6},
    "deep parts": {"meta.json": META, "result.json": '[{"children": ' * 900},
    "number of meta": {"meta.json": '{"model_cat": %s}' % ("9" * 5000)},
    "a million faces": {"a.obj": CORNERS + "f 1 2 3\n" * 1_000_000},
    "a polygon of a million corners": {"a.obj": CORNERS + "f" + " 1 2 3" * 400_000 + "\n"},
    "a long word": {"a.obj": "v " + "9" * 10**6},
    "an index of many digits": {"a.obj": CORNERS + f"f 1 2 {'9' * 5000}"},
    "laughing XML": {
        "mobility.urdf": '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa">'
        + "".join(f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in zip("abcdefghi", "bcdefghij", strict=True))
        + "]><robot>&j;</robot>"
    },
    "deep XML": {"mobility.urdf": "<robot>" * 100_000},
    "many links": {
        "mobility.urdf": "<robot>" + "".join(f'<link name="{i}"/>' for i in range(50_000)) + "</robot>"
    },
    "no encoding": {"mobility.urdf": '<?xml version="1.0" encoding="nobody"?><robot/>'},
    "a name with NUL": {"mobility.urdf": URDF.replace("a.obj", "a&#1;.obj")},
    "a long name": {"mobility.urdf": URDF.replace("a.obj", f"{LONG}.obj")},
    "long texture": {
        "a.obj": "mtllib a.mtl\nusemtl m\n" + CORNERS + "f 1 2 3\n",
        "a.mtl": f"newmtl m\nmap_Kd {LONG}.png",
    },
    "garbage": {"a.obj": bytes(range(256)) * 100},
}


@pytest.mark.parametrize("content", FOLDERS.values(), ids=FOLDERS)
@pytest.mark.parametrize("zipped", [False, True], ids=["folder", "zip"])
def test_folders_of_partnet(content: dict[str, str | bytes], zipped: bool, place: Path) -> None:
    files = {"meta.json": META, "mobility.urdf": URDF, "a.obj": CORNERS + "f 1 2 3\n"} | content
    given = place / ("object.zip" if zipped else "object")
    if zipped:
        with zipfile.ZipFile(given, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, text in files.items():
                archive.writestr(name, text)
    else:
        given.mkdir()
        for name, text in files.items():
            (given / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    said = check_call("import_partnet", lambda: artiskill.import_partnet(given))
    assert said or content is FOLDERS["long texture"]  # which is told of in the object's warnings


@pytest.mark.parametrize("name", ["meta.json", "mobility.urdf", "result.json", "a.obj", "a.mtl"])
def test_pipes_and_devices_of_partnet(name: str, place: Path) -> None:
    for number, other in enumerate(("pipe", "device")):
        folder = place / f"object-{number}"
        folder.mkdir()
        files = {"meta.json": META, "mobility.urdf": URDF, "a.obj": "mtllib a.mtl\n" + CORNERS + "f 1 2 3\n"}
        for file, text in files.items():
            (folder / file).write_text(text)
        (folder / name).unlink(missing_ok=True)
        (folder / name).symlink_to(place / other)
        check_call(name, lambda folder=folder: artiskill.import_partnet(folder))


@pytest.mark.parametrize("name", ["artiskill.json", "object.npz", "mobility.urdf"])
def test_pipes_and_devices_of_exports(name: str, place: Path) -> None:
    for other in ("pipe", "device", "garbage"):
        folder = export_object(load_object("bucket-0001"), "urdf", place / f"object-{other}").parent
        (folder / "mobility.urdf").write_text("<robot/>")
        (folder / name).unlink()
        (folder / name).symlink_to(place / other)
        assert check_call(f"{name} {other}", lambda folder=folder: load_object(folder))


def test_a_zip_that_unpacks_to_much(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("artiskill.assets.partnet.folder._MOST_ZIP_BYTES", 5_000_000)
    with zipfile.ZipFile(place / "bomb.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("mobility.urdf", URDF)
        with archive.open("a.obj", "w", force_zip64=True) as file:
            for _ in range(6):
                file.write(bytes(10**6))
    assert "unpacks to more" in check_call("zip", lambda: load_object("bomb.zip"))


MANIFESTS: dict[str, str | bytes] = {
    "deep": "[" * 10**6,
    "deep files": '{"format": "artiskill-demonstrations", "schema_version": 2, "files": '
    + '{"a":' * 900
    + "1"
    + "}" * 901,
    "digits": "9" * 5000,
    "bytes": b"\xff\xfe",
    "list": "[]",
    "null": "null",
    "format": json.dumps({"format": ["a"], "schema_version": {}}),
    "files": json.dumps({"format": "artiskill-demonstrations", "schema_version": 2, "files": [1], "settings": 3}),
}


@pytest.mark.parametrize("text", MANIFESTS.values(), ids=MANIFESTS)
def test_manifests(text: str | bytes, place: Path) -> None:
    folder = place / "demos"
    folder.mkdir()
    (folder / "manifest.json").write_bytes(text if isinstance(text, bytes) else text.encode())
    for reader in (Demos, TrainingFiles, verify, folder_stats):
        assert check_call(reader.__name__, lambda reader=reader: reader(folder))
    for other in ("pipe", "device"):
        (folder / "manifest.json").unlink()
        (folder / "manifest.json").symlink_to(place / other)
        assert check_call(other, lambda: Demos(folder))
