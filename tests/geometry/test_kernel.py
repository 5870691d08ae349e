"""How kernels are compiled, kept, and announced while they are being compiled."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from numba.core.errors import NumbaError

from artiskill.geometry import kernel_cache
from artiskill.geometry.kernel import allocating_kernel, inlined_kernel, kernel, structure_kernel
from artiskill.geometry.kernel_cache import sources_digest

# compiles one kernel that calls others; prints how many functions were compiled, and what it computes
_FIRST_USE = """
import json, sys
import numpy as np
from numba.core import event
from artiskill.geometry import kernel_cache
kernel_cache.CHECK_EVERY_S, kernel_cache.SHORT_S = 0.01, 0.02
from artiskill.sensors.drawing.shadows import draw_heights
compiled = []
class Listener(event.Listener):
    def on_start(self, e): compiled.append(e.data["dispatcher"].py_func.__name__)
    def on_end(self, e): pass
event.register("numba:compile", Listener())
corners = np.array([[1.0, 1.0, 1.0], [6.0, 1.0, 1.0], [1.0, 6.0, 1.0]])
heights = np.full((8, 8), -np.inf, dtype=np.float32)
draw_heights(corners, np.array([[0, 2, 1], [0, 1, 2]], dtype=np.int32), heights, np.empty((8, 8), dtype=np.int32))
json.dump([len(compiled), int(np.isfinite(heights).sum())], sys.stdout)
"""
_ANNOUNCED = "artiskill: compiling kernels for this processor, about "


def start_first_use(cache: Path, **variables: str) -> subprocess.Popen[str]:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache), **variables}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([sys.executable, "-c", _FIRST_USE], env=environment, **pipes)


def finish(process: subprocess.Popen[str]) -> tuple[int, int, str]:
    """Functions compiled, pixels drawn, standard error."""
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    return (*json.loads(out), err)


def test_only_a_first_use_compiles_and_says_so(tmp_path: Path) -> None:
    compiled, drawn, said = finish(start_first_use(tmp_path, ARTISKILL_PROCESS_TREE="one"))
    assert compiled > 5
    assert drawn == 15
    assert said.startswith(_ANNOUNCED)
    assert said.count("\n") == 1
    assert str(tmp_path) in said
    assert finish(start_first_use(tmp_path, ARTISKILL_PROCESS_TREE="two")) == (0, 15, "")


def test_of_several_processes_one_compiles_and_one_says_so(tmp_path: Path) -> None:
    workers = [start_first_use(tmp_path, ARTISKILL_PROCESS_TREE="a tree") for _ in range(3)]
    results = [finish(worker) for worker in workers]
    assert sorted(compiled > 0 for compiled, _, _ in results) == [False, False, True]
    assert {drawn for _, drawn, _ in results} == {15}
    assert "".join(said for _, _, said in results).count(_ANNOUNCED) == 1


def test_damaged_files_are_compiled_anew(tmp_path: Path) -> None:
    finish(start_first_use(tmp_path))
    for path in tmp_path.rglob("*.nb[ic]"):
        path.write_bytes(path.read_bytes()[:100])
    compiled, drawn, _ = finish(start_first_use(tmp_path))
    assert compiled > 5
    assert drawn == 15
    assert finish(start_first_use(tmp_path))[0] == 0


def test_the_digest_changes_with_any_kernel(tmp_path: Path) -> None:
    called, other = tmp_path / "called.py", tmp_path / "other.py"
    called.write_text("@kernel\ndef f(): ...")
    other.write_text("x = 1")
    digest = sources_digest(tmp_path)
    other.write_text("x = 2")
    assert sources_digest(tmp_path) == digest, "no kernel in there"
    called.write_text("@kernel\ndef f(): pass")
    assert sources_digest(tmp_path) != digest


def test_the_folder_is_the_first_that_can_be_written_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    blocked = tmp_path / "a file"
    blocked.write_text("")
    find = kernel_cache.kernel_folder.__wrapped__
    monkeypatch.setattr(kernel_cache.numba.config, "CACHE_DIR", str(blocked))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    assert find().parent == tmp_path / "home" / "artiskill" / "kernels"
    monkeypatch.setenv("XDG_CACHE_HOME", str(blocked))
    monkeypatch.setattr(kernel_cache, "_PACKAGE", tmp_path / "package")
    assert find().parent == tmp_path / "package" / "__pycache__" / "kernels"
    monkeypatch.setattr(kernel_cache, "_PACKAGE", blocked)
    assert find() is None


def test_old_folders_are_forgotten(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for k in range(20):
        folder = tmp_path / "kernels" / f"old-{k}"
        folder.mkdir(parents=True)
        os.utime(folder, (k, k))
    monkeypatch.setattr(kernel_cache.numba.config, "CACHE_DIR", str(tmp_path))
    folder = kernel_cache.kernel_folder.__wrapped__()
    kept = {path.name for path in folder.parent.iterdir()}
    assert kept == {folder.name, *(f"old-{k}" for k in range(13, 20))}


@kernel
def _scaled(value: float, factor: float) -> float:
    return value * factor


@inlined_kernel
def _add(table: np.ndarray, i: int, value: float) -> None:
    table[i] += value


@kernel
def _accumulate(table: np.ndarray, factor: float) -> None:
    for i in range(table.shape[0]):
        _add(table, i, _scaled(table[i], factor))


@pytest.mark.filterwarnings("ignore")
def test_a_kernel_is_called_from_python_and_from_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    table = np.array([1.0, 2.0])
    _accumulate(table, 3.0)
    assert table.tolist() == [4.0, 8.0]
    assert _scaled(2.0, 3.0) == 6.0, "compiled for Python too"
    single = np.array([1.0], dtype=np.float32)
    _accumulate(single, 0.5)
    assert single.tolist() == [1.5]


class _Pair(NamedTuple):
    left: np.ndarray
    right: np.ndarray


@structure_kernel
def _pair_at(pairs: _Pair, k: int) -> _Pair:
    return _Pair(pairs.left[k], pairs.right[k])


@kernel
def _add_pair(pairs: _Pair, k: int) -> None:
    pair = _pair_at(pairs, k)
    for i in range(pair.left.shape[0]):
        pair.left[i] += pair.right[i]


@allocating_kernel
def _doubled(values: np.ndarray) -> np.ndarray:
    twice = np.empty(values.shape[0])
    for i in range(values.shape[0]):
        twice[i] = _scaled(values[i], 2.0)
    return twice


@allocating_kernel
def _summed_twice(values: np.ndarray) -> float:
    return _doubled(values).sum()


@pytest.mark.filterwarnings("ignore")
def test_structures_and_new_arrays_live_as_long_as_they_are_used() -> None:
    pairs = _Pair(np.arange(6.0).reshape(2, 3), np.ones((2, 3)))
    held = sys.getrefcount(pairs.left)
    for _ in range(3):
        _add_pair(pairs, 1)
        second = _pair_at(pairs, 1).left.tolist()
    held_now = sys.getrefcount(pairs.left)
    assert second == [6.0, 7.0, 8.0]
    assert held_now == held
    assert _doubled(np.arange(3.0)).tolist() == [0.0, 2.0, 4.0]
    assert _summed_twice(np.arange(3.0)) == 6.0


_ONES = _Pair(np.ones((1, 1)), np.ones((1, 1)))


def _making_one(count: int) -> float:
    return np.empty(count)[0]


def _handing_out(pairs: _Pair) -> _Pair:
    return _Pair(pairs.right, pairs.left)


def _calling_one_that_allocates(values: np.ndarray) -> float:
    return _doubled(values)[0]


def _allocating_over_structures(pairs: _Pair) -> float:
    return _pair_at(pairs, 0).left[0] + np.empty(1)[0]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("decorate", "function", "given", "why"),
    [
        (kernel, _making_one, 3, "Only accept returning of array passed"),
        (kernel, _handing_out, _ONES, "allocating_kernel or a structure_kernel"),
        (kernel, _calling_one_that_allocates, np.ones(3), "_doubled returns arrays"),
        (allocating_kernel, _allocating_over_structures, _ONES, "_pair_at returns arrays"),
    ],
)
def test_arrays_whose_references_nobody_counts_are_refused(
    decorate: Callable, function: Callable, given: object, why: str
) -> None:
    with pytest.raises(NumbaError, match=why):
        decorate(function)(given)


@kernel
def _with_numbers(values: np.ndarray) -> float:
    return _scaled(values[0], 1) + _scaled(values[0], 2) + _scaled(values[0], 3)


@pytest.mark.filterwarnings("ignore")
def test_numbers_written_out_are_compiled_once() -> None:
    known = len(_scaled.within.overloads)
    assert _with_numbers(np.ones(1)) == 6.0
    assert len(_scaled.within.overloads) == known + 1
