"""Products and functions with the same bits everywhere, and the rooms that may use no others."""

import ast
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import artiskill
from artiskill.geometry.arrays import (
    arccos,
    arcsin,
    arctan2,
    dot,
    exp,
    matmul,
    power,
    rotate,
    small_product,
    total,
)

SOURCE = Path(artiskill.__file__).parent
ROOMS = ("geometry", "assets", "robots", "scene", "sim", "sensors", "tasks", "envs", "experts")
# NumPy hands these to BLAS or LAPACK, or has several codes for them, for several processors
UNLIKE = {
    *("dot", "vdot", "inner", "tensordot", "einsum", "matmul", "vecdot", "matvec", "vecmat", "linalg", "cov"),
    *("exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "logaddexp", "power", "pow", "float_power", "cbrt"),
    *("tan", "arcsin", "arccos", "arctan", "arctan2", "asin", "acos", "atan", "atan2"),
    *("sinh", "cosh", "tanh", "arcsinh", "arccosh", "arctanh", "asinh", "acosh", "atanh"),
    *("geomspace", "logspace", "polyfit", "corrcoef", "convolve", "correlate"),
}
# file or folder -> why it may
EXEMPT = {
    "geometry/arrays.py": "calls them for arrays of other libraries",
    "assets/partnet": "imports from files, with CoACD: no hash of a catalogue is compared",
    "experts/mpc.py": "checks whether objects can be solved, by plans that are drawn",
    "sensors/camera.py": "whether a matrix is a rotation, to within 1e-6",
    "sensors/pictures/framing.py": "where to look from, for pictures of objects",
    "sensors/pictures/objects.py": "pictures of objects",
    "sensors/pictures/compose.py": "drawings for people",
    "sensors/drawing/shading.py": "powers of single numbers, by the C library",
}


@pytest.mark.parametrize("inner", [1, 2, 3, 9])
def test_products_are_products(inner: int) -> None:
    rng = np.random.default_rng(inner)
    a, b, v = rng.normal(size=(5, 4, inner)), rng.normal(size=(5, inner, 7)), rng.normal(size=(5, inner))
    np.testing.assert_allclose(matmul(a, b), a @ b, atol=1e-14)
    np.testing.assert_allclose(matmul(a[0], b), a[0] @ b, atol=1e-14)
    np.testing.assert_allclose(rotate(a, v), (a @ v[..., None])[..., 0], atol=1e-14)
    np.testing.assert_allclose(dot(v, v[0]), (v * v[0]).sum(axis=1), atol=1e-14)


@pytest.mark.parametrize("a", [(3,), (4, 3), (5, 4, 3)])
@pytest.mark.parametrize("b", [(3,), (3, 2), (5, 3, 2)])
def test_small_products_are_products(a: tuple[int, ...], b: tuple[int, ...]) -> None:
    rng = np.random.default_rng(0)
    left, right = rng.normal(size=a), rng.normal(size=b)
    found = small_product(left, right)
    assert np.shape(found) == np.shape(left @ right)
    np.testing.assert_allclose(found, left @ right, atol=1e-14)


def test_a_product_adds_from_first_to_last() -> None:
    values = np.array([[1e16, 1.0, -1e16, 1.0]])
    assert matmul(values, np.ones((4, 1)))[0, 0] == ((1e16 + 1.0) - 1e16) + 1.0


def test_a_total_adds_from_first_to_last_on_every_python() -> None:
    """The built-in `sum` compensates since Python 3.12: 2.0 there."""
    assert total([1e16, 1.0, -1e16, 1.0]) == ((1e16 + 1.0) - 1e16) + 1.0 == 1.0
    assert total(np.array([[0.1, 1e16], [0.2, 1.0], [0.3, -1e16]])).tolist() == [0.1 + 0.2 + 0.3, 0.0]
    assert total([]) == 0.0


def test_functions_are_those_of_the_c_library_one_number_at_a_time() -> None:
    x = np.random.default_rng(0).uniform(-1, 1, (7, 11))
    y = np.abs(x[::-1])
    for found, function in (
        (arccos(x), math.acos),
        (arcsin(x), math.asin),
        (exp(x), math.exp),
    ):
        assert found.tolist() == [[function(value) for value in row] for row in x.tolist()]
    assert arctan2(x[0], y).tolist() == [[math.atan2(*pair) for pair in zip(x[0], row, strict=True)] for row in y]
    assert power(y, 0.7).tolist() == [[math.pow(value, 0.7) for value in row] for row in y.tolist()]
    assert arccos(np.array(0.5)).shape == ()
    assert arccos(np.zeros((0, 3))).shape == (0, 3)


def test_numpy_has_the_c_librarys_sines() -> None:
    """So that they need not stand among those that differ."""
    x = np.random.default_rng(0).uniform(-10, 10, 1000)
    assert np.sin(x).tolist() == [math.sin(value) for value in x.tolist()]
    assert np.cos(x).tolist() == [math.cos(value) for value in x.tolist()]


def unlike(text: str) -> Iterator[tuple[int, str]]:
    """Where a source uses what may have other bits on another processor, or on another Python."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.BinOp | ast.AugAssign) and isinstance(node.op, ast.MatMult):
            yield node.lineno, "@"
        elif isinstance(node, ast.BinOp | ast.AugAssign) and isinstance(node.op, ast.Pow):
            base, exponent = (node.left, node.right) if isinstance(node, ast.BinOp) else (node.target, node.value)
            square = isinstance(exponent, ast.Constant) and exponent.value == 2
            if not square and not isinstance(base, ast.Constant):
                yield node.lineno, "**"
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "sum":
            if not counts_lengths(node.args[0]):
                yield node.lineno, "sum"
        elif isinstance(node, ast.Attribute) and node.attr in UNLIKE and not is_module(node.value, "math"):
            yield node.lineno, node.attr


def is_module(node: ast.expr, name: str) -> bool:
    return isinstance(node, ast.Name) and node.id == name


def counts_lengths(node: ast.expr) -> bool:
    """Whether what is added up are lengths, and so integers: `map(len, ...)` or `len(x) for x in ...`."""
    if isinstance(node, ast.GeneratorExp):
        return isinstance(node.elt, ast.Call) and ast.unparse(node.elt.func) == "len"
    return isinstance(node, ast.Call) and ast.unparse(node).startswith("map(len, ")


def test_a_use_is_seen() -> None:
    differing = ("a @ b", "x.dot(y)", "np.exp(x)", "xp.acos(x)", "x**0.7", "x **= 3", "np.linalg.inv", "sum(x)")
    alike = ("x **= 2", "x**2", "2**31", "math.exp(1)", "exp(x)", "np.sqrt(x)", "np.sin(x)", "sum(map(len, x))")
    assert all(list(unlike(text)) for text in differing)
    assert not any(list(unlike(text)) for text in alike)


def test_rooms_whose_bits_count_use_nothing_that_differs_elsewhere() -> None:
    found = []
    for path in sorted(path for room in ROOMS for path in (SOURCE / room).rglob("*.py")):
        name = path.relative_to(SOURCE).as_posix()
        if not any(name == exempt or name.startswith(exempt + "/") for exempt in EXEMPT):
            found += [f"{name}:{line} {what}" for line, what in unlike(path.read_text(encoding="utf-8"))]
    assert not found, "use artiskill.geometry.arrays, or math for single numbers"


def test_exemptions_exist() -> None:
    assert all((SOURCE / name).exists() for name in EXEMPT)


def test_single_numbers_and_whole_ones_too() -> None:
    x, y = np.random.default_rng(1).uniform(-1, 1, (2, 500))
    for a, b in zip(x, y, strict=True):
        assert (arcsin(a), arccos(a)) == (math.asin(a), math.acos(a))
        assert arctan2(a, b) == math.atan2(a, b)
    assert arctan2(y[0], x).tolist() == [math.atan2(y[0], value) for value in x]
    assert exp(np.array([1, 2])).tolist() == [math.exp(1), math.exp(2)]
