"""Every fault of a solution file: one clear line that says what, where, and what would be legal."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from artiskill.envs.wrappers import Sampling
from artiskill.errors import PolicyError
from artiskill.evaluation import solution_process
from artiskill.evaluation.solution import FileSolution, ObjectSolution, Solution

Write = Callable[[str], Path]
INFO = {"object": "cabinet-0005", "level": 4, "target": "link_1", "success": False, "flags": {}}
CLASS = """
class Policy:
    obs_mode = "state"
    def reset(self, observation, info):
        self.info = info
    def act(self, observation):
        return [0.5] * 13
"""


def begin(path: Path) -> Solution:
    found = FileSolution(path)
    found.reset(np.zeros(3), INFO)
    return found


def complaint(path: Path, act: bool = False) -> str:
    """The message of the error, which names the file and is one line."""
    with pytest.raises(PolicyError) as caught:
        begin(path).act(np.zeros(3), (13,)) if act else begin(path)
    message = str(caught.value)
    assert str(path) in message
    assert "\n" not in message
    return message


def test_a_function(solution: Write) -> None:
    found = begin(solution("def policy(observation):\n    return observation.tolist() * 4 + [0]\n"))
    assert found.obs_mode is None
    np.testing.assert_array_equal(found.act(np.ones(3), (13,)), [1.0] * 12 + [0.0])


def test_a_class(solution: Write) -> None:
    found = begin(solution(CLASS))
    assert found.obs_mode == "state"
    np.testing.assert_array_equal(found.act(np.zeros(3), (13,)), np.full(13, 0.5))


def test_a_file_is_told_the_number_of_the_episode_and_nothing_else(solution: Write) -> None:
    found = FileSolution(solution(CLASS.replace("[0.5] * 13", "len(self.info) * [0.0] + [self.info['episode']]")))
    for episode in range(3):
        found.reset(np.zeros(3), INFO)
        assert found.act(np.zeros(3), (2,)).tolist() == [0.0, episode]


def test_an_object_is_told_which_episode_it_plays() -> None:
    class Policy:
        obs_mode = "state"

        def reset(self, observation: np.ndarray, info: dict[str, object]) -> None:
            self.info = info

        def act(self, observation: np.ndarray) -> list[float]:
            return [0.0] * 13

    policy = Policy()
    ObjectSolution(policy).reset(np.zeros(3), INFO)
    assert policy.info == {"object": "cabinet-0005", "level": 4, "target": "link_1"}


def test_modules_beside_the_file_can_be_imported(
    solution: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    (tmp_path / "neighbour_of_solution.py").write_text("VALUE = 0.25\n")
    path = solution("from neighbour_of_solution import VALUE\ndef policy(o):\n    return [VALUE] * 13\n")
    np.testing.assert_array_equal(begin(path).act(np.zeros(3), (13,)), np.full(13, 0.25))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["neighbour_of_solution.py", "solution.py"]


def test_global_generators_follow_the_episode(solution: Write) -> None:
    path = solution(
        "import numpy as np, random\ndef policy(o):\n    return np.random.rand(13) + random.random()\n"
    )
    one = begin(path)
    first, again = one.act(np.zeros(3), (13,)), begin(path).act(np.zeros(3), (13,))
    np.testing.assert_array_equal(first, again)
    one.reset(np.zeros(3), INFO)
    assert not np.array_equal(first, one.act(np.zeros(3), (13,)))


def test_missing_file(tmp_path: Path) -> None:
    assert "does not exist" in complaint(tmp_path / "nothing.py")
    assert "cannot be read" in complaint(tmp_path)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("x = 1\ndef policy(o:\n    pass\n", ("SyntaxError", "line 2")),
        ("\nimport no_such_module\n", ("cannot be imported: ModuleNotFoundError", "no_such_module", "line 2")),
        ("def f():\n    raise ValueError('one\\ntwo')\nf()\n", ("ValueError: one two", "line 2")),
        ("import sys\nsys.exit(3)\n", ("SystemExit: 3", "line 2")),
        ("a = 1\n", ("neither 'policy' nor 'Policy'", "a function policy(observation)", "a class Policy")),
        ("def POLICY(o): pass\n", ("neither", "'POLICY'")),
        (CLASS + "def policy(o): pass\n", ("both 'policy' and 'Policy'",)),
        ("policy = 3\n", ("'policy' is 'int', not a function",)),
        ("Policy = 3\n", ("'Policy' is 'int', not a class",)),
        ("class Policy:\n    obs_mode = 'state'\n    def act(self, o): pass\n", ("lacks reset",)),
        ("class Policy:\n    pass\n", ("lacks obs_mode, reset, act",)),
        (CLASS.replace('"state"', '"stat"'), ("unknown obs_mode 'stat'", "'state'")),
        (CLASS + "    control_mode = 'twist'\n", ("unknown control_mode 'twist'", "joint, operational_space")),
        (CLASS + "    def __init__(self, size):\n        pass\n", ("Policy() raised TypeError", "size")),
        (CLASS + "    def __init__(self):\n        1 / 0\n", ("Policy() raised ZeroDivisionError", "line 9")),
        (CLASS.replace("self.info = info", "info['x']"), ("reset() raised KeyError: 'x'", "line 5", "level 4")),
    ],
)
def test_faults_of_the_file(solution: Write, text: str, says: tuple[str, ...]) -> None:
    message = complaint(solution(text))
    assert all(part in message for part in says), message


@pytest.mark.parametrize(
    ("returns", "says"),
    [
        ("1 / 0", ("raised ZeroDivisionError: division by zero", "line 2")),
        ("exit()", ("raised SystemExit", "line 2")),
        ("None", ("returned None",)),
        ("[0.0] * 12", ("returned shape (12,)",)),
        ("0.0", ("returned shape ()",)),
        ("[[0.0] * 13]", ("returned shape (1, 13)",)),
        ("[0.0] * 12 + [float('nan')]", ("returned [nan] in entries [12]",)),
        ("[float('inf')] + [0.0] * 12", ("returned [inf] in entries [0]",)),
        ("'forward'", ("returned str, not an array",)),
        ("[[1, 2], [3]]", ("returned list, not an array",)),
        ("object()", ("returned object, not an array",)),
    ],
)
def test_faults_of_an_action(solution: Write, returns: str, says: tuple[str, ...]) -> None:
    message = complaint(solution(f"def policy(o):\n    return {returns}\n"), act=True)
    for part in (*says, "policy()", "object cabinet-0005, level 4, step 0"):
        assert part in message, message
    assert "raised" in message or "an action is 13 finite numbers in [-1, 1]" in message


def test_ctrl_c_in_a_policy_of_this_process_is_not_its_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    # a shell that starts the tests in the background has it ignored, and no Ctrl-C reaches them
    monkeypatch.setattr("signal.getsignal", lambda number: signal.default_int_handler)

    def policy(observation: np.ndarray) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        ObjectSolution(policy).act(np.zeros(3), (13,))


@pytest.mark.parametrize("policy", [3, dict, type("Half", (), {"act": lambda self, o: o})()])
def test_objects_that_are_no_policy(policy: object) -> None:
    with pytest.raises(PolicyError, match="a solution has either"):
        ObjectSolution(policy)


CLOUDS = CLASS.replace('"state"', '"pointcloud"') + "    sampling = "


def test_a_sampling(solution: Write) -> None:
    found = begin(solution(CLOUDS + '{"num_points": 256, "frame": "robot"}\n'))
    assert found.sampling == Sampling(256, frame="robot")
    assert begin(solution(CLASS)).sampling is None


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (CLASS + "    sampling = {}\n", "sampling is for obs_mode 'pointcloud', not for 'state'"),
        (CLOUDS + "256\n", "sampling: it must be a mapping of keys to values, not 256"),
        (CLOUDS + "{'points': 256}\n", "unknown key 'points'; did you mean 'num_points'?"),
        (CLOUDS + "{'frame': 'hand'}\n", "unknown frame 'hand'"),
        (CLOUDS + "{'num_points': 0}\n", "num_points"),
        (CLASS + "    observation_config = {'episode_steps': 9}\n", "'cameras', 'render', 'state' only"),
        (CLASS + "    observation_config = 64\n", "the sections 'cameras', 'render', 'state' only, not 64"),
    ],
)
def test_illegal_wishes(solution: Write, text: str, says: str) -> None:
    assert says in complaint(solution(text))


# -- the process --------------------------------------------------------------------------------------------------


def test_observations_arrive_as_they_are_and_may_be_written_to(solution: Write, rng: np.random.Generator) -> None:
    path = solution(
        "import numpy as np\nseen = []\n"
        "def policy(o):\n"
        "    cloud = o['pointcloud']\n    seen.append(cloud['xyz'])\n"
        "    cloud['xyz'] += 1\n"
        "    kinds = [(k, v.dtype.str, v.shape) for k, v in (*cloud.items(), ('agent', o['agent']))]\n"
        "    assert kinds == [('xyz', '<f4', (5, 3)), ('rgb', '|u1', (5, 3)), ('seg', '|b1', (5, 3)),"
        " ('agent', '<f4', (7,))], kinds\n"
        "    return [seen[0].sum() - 15, cloud['rgb'].sum(), cloud['seg'].sum(), o['agent'][-1], len(seen)]\n"
    )
    cloud = {
        "xyz": rng.normal(size=(5, 3)).astype(np.float32),
        "rgb": rng.integers(0, 9, (5, 3)).astype(np.uint8),
        "seg": rng.random((5, 3)) < 0.5,
    }
    observation = {"pointcloud": cloud, "agent": rng.normal(size=7).astype(np.float32)}
    found = FileSolution(path)
    found.reset(observation, INFO)
    for step in (1, 2):
        action = found.act(observation, (5,))
        assert action[1:].tolist() == [cloud["rgb"].sum(), cloud["seg"].sum(), observation["agent"][-1], step]
        assert action[0] == pytest.approx(cloud["xyz"].sum(), abs=1e-4), "what it keeps is not overwritten"


def test_nothing_of_the_evaluator_is_in_the_process(solution: Write) -> None:
    path = solution(
        "import gc, sys\n"
        "loaded = [name for name in sys.modules if name.partition('.')[0] in ('artiskill', 'mujoco')]\n"
        "held = [o for o in gc.get_objects() if 'artiskill' in str(type(o).__module__)]\n"
        "assert not loaded and not held and not any('cabinet' in a for a in sys.argv), (loaded, held, sys.argv)\n"
        "def policy(o):\n    return [0.0]\n"
    )
    assert begin(path).act(np.zeros(3), (1,)).tolist() == [0.0]


HEAD = "import os, struct, sys, socket, time\nchannel = socket.socket(fileno=int(sys.argv[1]))\n"
SEND = "channel.sendall(struct.pack('=cxxxI', {kind!r}, {length}) + {body})\n"
BROKEN = "its process does not keep to the protocol"
# what the policy does in its third step, and what is said of it
LIES = {
    "too much": (
        SEND.format(kind=b"a", length=16, body="bytes(16)"),
        "answers with 16 bytes, at most 8 are legal",
    ),
    "far too much": (SEND.format(kind=b"a", length=4_000_000_000, body="b''"), "answers with 4000000000 bytes"),
    "too little": (SEND.format(kind=b"a", length=4, body="bytes(4)"), "an action of 4 bytes, 8 of finite numbers"),
    "nan": (
        SEND.format(kind=b"a", length=8, body="struct.pack('d', float('nan'))"),
        "of finite numbers are legal",
    ),
    "another kind": (SEND.format(kind=b"o", length=0, body="b''"), "answers b'o', not b'a'"),
    "unknown kind": (SEND.format(kind=b"?", length=0, body="b''"), "answers b'?', not b'a'"),
    "no complaint": (SEND.format(kind=b"f", length=2, body="b'{}'"), "its complaint makes no sense"),
    "long complaint": (SEND.format(kind=b"f", length=200_000, body="bytes(200_000)"), "answers with 200000 bytes"),
    "talks on": (SEND.format(kind=b"a", length=8, body="bytes(30)"), "it talks on after its answer"),
    "twice": (SEND.format(kind=b"a", length=8, body="bytes(8)"), "it talks "),
    "flood": ("while True:\n            channel.sendall(b'a' * 100_000)", "answers with"),
    "closes": ("channel.shutdown(socket.SHUT_RDWR)", "it closed its socket"),
}


def act_slowly(found: Solution) -> None:
    for _ in range(5):
        found.act(np.zeros(3), (1,))
        time.sleep(0.05)


@pytest.mark.parametrize("kind", LIES)
def test_lies_are_told(solution: Write, kind: str) -> None:
    text, says = LIES[kind]
    wait = 0.0 if kind == "twice" else 300.0
    path = solution(
        f"{HEAD}steps = []\ndef policy(o):\n    steps.append(1)\n"
        f"    if len(steps) == 3:\n        {text.rstrip()}\n        time.sleep({wait})\n    return [0.0]\n"
    )
    found = begin(path)
    start = time.perf_counter()
    with pytest.raises(PolicyError) as caught:
        act_slowly(found)
    assert says in str(caught.value)
    assert str(caught.value).startswith(f"{path}: {BROKEN}: ")
    assert "(object cabinet-0005, level 4, step " in str(caught.value)
    assert time.perf_counter() - start < 120
    found.close()
    assert found._process._process.returncode is not None


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("os._exit(3)", "its process ended (exit status 3): the policy ended it, or memory ran out"),
        ("os.kill(os.getpid(), 9)", "its process ended (killed by signal 9, Killed)"),
        ("raise ValueError('\\x1b[31m' + 'x' * 5000)", r"raised ValueError: \x1b[31mxxx"),
    ],
)
def test_a_process_that_ends_is_told(solution: Write, text: str, says: str) -> None:
    found = begin(solution(f"import os\ndef policy(o):\n    {text}\n"))
    with pytest.raises(PolicyError) as caught:
        found.act(np.zeros(3), (1,))
    assert says in str(caught.value)
    assert len(str(caught.value)) < 1000


def test_a_traceback_comes_with_the_error(solution: Write) -> None:
    found = begin(solution("def inner():\n    return {}['gripper']\ndef policy(o):\n    return inner()\n"))
    with pytest.raises(PolicyError, match=r"raised KeyError: 'gripper' \(line 2, ") as caught:
        found.act(np.zeros(3), (1,))
    assert "line 4, in policy" in caught.value.__notes__[0]


def test_the_process_ends_with_its_owner(solution: Write) -> None:
    found = begin(solution("def policy(o):\n    return [0.0]\n"))
    process = found._process._process
    del found
    assert process.returncode is not None


def test_the_program_needs_nothing_of_the_package() -> None:
    source = Path(solution_process.__file__).read_text()
    assert "artiskill." not in "".join(line for line in source.splitlines() if line.startswith(("import", "from")))
    code = (
        f"import sys, runpy; runpy.run_path({solution_process.__file__!r}); assert 'artiskill' not in sys.modules"
    )
    subprocess.run([sys.executable, "-P", "-c", code], check=True)


@pytest.mark.parametrize(
    "declared", ["3", "{}", '{"obs_mode": "state", "level": 3}', "[", '{"obs_mode": ["state"]}']
)
def test_declarations_that_are_none(solution: Write, declared: str) -> None:
    body = json.dumps(declared)
    path = solution(
        f"{HEAD}body = {body}.encode()\n"
        + SEND.format(kind=b"d", length="len(body)", body="body")
        + "time.sleep(60)\n"
    )
    with pytest.raises(PolicyError, match=r"its declaration makes no sense|unknown obs_mode"):
        FileSolution(path)


def test_a_step_costs_little(solution: Write) -> None:
    """At most 0.5 ms with 1,200 points; the least of some is not disturbed by what else the machine does."""
    found = FileSolution(solution("import numpy as np\ndef policy(o):\n    return np.zeros(13)\n"))
    cloud = {"xyz": np.zeros((1200, 3), np.float32), "rgb": np.zeros((1200, 3), np.uint8)}
    observation = {"pointcloud": cloud | {"seg": np.zeros((1200, 3), bool)}, "agent": np.zeros(38, np.float32)}
    found.reset(observation, INFO)
    times = []
    for _ in range(300):
        start = time.perf_counter()
        found.act(observation, (13,))
        times.append(time.perf_counter() - start)
    assert min(times) < 0.5e-3, f"{np.median(times) * 1e3:.2f} ms"
    assert os.getpid() != found._process._process.pid
