"""The same bits on every Python, which digests in the repository show, and on other processors.

For the latter, NumPy and BLAS are told to do without what this processor has. Both choose their code when they are
imported, hence the processes. Where a switch changes nothing (another NumPy, an older processor), there is nothing
to see, and the test is skipped.
"""

import json
import os
import subprocess
import sys
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import artiskill

from .bits import RECORDED, acting, digests, few, probes, whole

ROOT = Path(__file__).resolve().parents[2]
PACK = Path(artiskill.__file__).parent / "demos" / "pack"

# what a processor with AVX2 and one with neither AVX2 nor FMA lack, for NumPy
AVX512 = ("AVX512", "X86_V4")
ALL = ("",)
PROCESSORS: dict[str, tuple[tuple[str, ...], str]] = {
    "AVX2": (AVX512, "Haswell"),
    "SSE4": (ALL, "Nehalem"),
    "AVX2 in NumPy alone": (AVX512, ""),
    "AVX2 in BLAS alone": ((), "Haswell"),
    "SSE3 in BLAS alone": ((), "Prescott"),
}


def environment(processor: str) -> dict[str, str]:
    """The variables that make NumPy and BLAS take this processor for another one."""
    prefixes, blas = PROCESSORS[processor]
    found: list[str] = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])  # type: ignore[index, call-overload]
    without = [name for name in found if name.startswith(prefixes)] if prefixes else []
    switches = {"NPY_DISABLE_CPU_FEATURES": " ".join(without), "OPENBLAS_CORETYPE": blas}
    return os.environ | {name: value for name, value in switches.items() if value}


@cache
def here(size: str) -> dict[str, str]:
    return digests(*(few() if size == "few" else whole()))


def test_objects_and_episodes_have_the_bits_that_are_recorded() -> None:
    """One Python alone notices that it computes something else than the others."""
    recorded = json.loads(RECORDED.read_text(encoding="utf-8"))
    unlike = [name for name, value in recorded["digests"].items() if here("few").get(name) != value]
    if unlike and recorded["mujoco-core"] != version("mujoco-core"):
        unlike = [name for name in unlike if name.startswith("object ")]
        if not unlike:
            pytest.skip(f"recorded with mujoco-core {recorded['mujoco-core']}, not {version('mujoco-core')}")
    assert recorded["digests"].keys() == here("few").keys()
    assert not unlike, "if bits are meant to change: python -m tests.contract.bits record"


@pytest.mark.parametrize(
    ("processor", "size"),
    [
        pytest.param("AVX2", "few", marks=pytest.mark.slow),
        ("SSE4", "few"),  # which no processor of today is
        *(pytest.param(name, "whole", marks=pytest.mark.slow) for name in PROCESSORS),
    ],
)
def test_objects_and_episodes_have_the_same_bits_on_another_processor(processor: str, size: str) -> None:
    command = [sys.executable, "-m", "tests.contract.bits", size]
    result = subprocess.run(command, cwd=ROOT, env=environment(processor), capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    there: dict[str, Any] = json.loads(result.stdout)
    if there["probes"] == probes():
        pytest.skip("NumPy and BLAS compute the same with these switches: nothing to compare")
    unlike = [name for name, value in here(size).items() if there["digests"][name] != value]
    assert there["digests"].keys() == here(size).keys()
    assert not unlike


@pytest.mark.parametrize("processor", [pytest.param("AVX2", marks=pytest.mark.slow), "SSE3 in BLAS alone"])
def test_experts_and_policies_act_the_same_on_another_processor(processor: str) -> None:
    command = [sys.executable, "-m", "tests.contract.bits", "acting"]
    result = subprocess.run(command, cwd=ROOT, env=environment(processor), capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    there: dict[str, Any] = json.loads(result.stdout)
    if there["probes"] == probes():
        pytest.skip("NumPy and BLAS compute the same with these switches: nothing to compare")
    assert there["digests"] == acting()
    assert len(there["digests"]) == 12


@pytest.mark.slow
@pytest.mark.parametrize("processor", ["AVX2", "SSE4"])
def test_the_demo_pack_verifies_on_another_processor(processor: str) -> None:
    command = [sys.executable, "-m", "artiskill", "demos", "verify", str(PACK), "--workers", "2"]
    result = subprocess.run(command, cwd=ROOT, env=environment(processor), capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
