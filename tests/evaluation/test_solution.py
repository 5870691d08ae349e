"""Every fault of a solution file: one clear line that says what, where, and what would be legal."""

import signal
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from artiskill.envs.wrappers import Sampling
from artiskill.errors import PolicyError
from artiskill.evaluation.solution import Solution, read_solution

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
    found = read_solution(path)
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


def test_info_holds_nothing_privileged(solution: Write) -> None:
    found = begin(solution(CLASS))
    assert found._act.__self__.info == {"object": "cabinet-0005", "level": 4, "target": "link_1"}


def test_modules_beside_the_file_can_be_imported(
    solution: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    (tmp_path / "neighbour_of_solution.py").write_text("VALUE = 0.25\n")
    path = solution("from neighbour_of_solution import VALUE\ndef policy(o):\n    return [VALUE] * 13\n")
    np.testing.assert_array_equal(begin(path).act(None, (13,)), np.full(13, 0.25))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["neighbour_of_solution.py", "solution.py"]


def test_global_generators_follow_the_level(solution: Write) -> None:
    path = solution(
        "import numpy as np, random\ndef policy(o):\n    return np.random.rand(13) + random.random()\n"
    )
    first, again = begin(path).act(None, (13,)), begin(path).act(None, (13,))
    np.testing.assert_array_equal(first, again)


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


def test_ctrl_c_in_a_solution_is_not_its_fault(solution: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    # a shell that starts the tests in the background has it ignored, and no Ctrl-C reaches them
    monkeypatch.setattr("signal.getsignal", lambda number: signal.default_int_handler)
    with pytest.raises(KeyboardInterrupt):
        begin(solution("def policy(o):\n    raise KeyboardInterrupt\n")).act(None, (13,))


@pytest.mark.parametrize("policy", [3, dict, type("Half", (), {"act": lambda self, o: o})()])
def test_objects_that_are_no_policy(policy: object) -> None:
    with pytest.raises(PolicyError, match="a solution has either"):
        Solution.of_object(policy)


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
        (CLASS + "    observation_config = {'episode_steps': 9}\n", "the sections 'cameras' and 'render' only"),
        (CLASS + "    observation_config = 64\n", "the sections 'cameras' and 'render' only, not 64"),
    ],
)
def test_illegal_wishes(solution: Write, text: str, says: str) -> None:
    assert says in complaint(solution(text))
