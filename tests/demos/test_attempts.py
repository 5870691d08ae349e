"""What ends single episodes and what ends a collection."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from artiskill.demos import attempts as module
from artiskill.demos.collect import collect
from artiskill.demos.demo_file import DemoFile
from artiskill.demos.plan import Plan
from artiskill.demos.verify import verify
from artiskill.errors import DivergedError, PolicyError, StateError
from artiskill.experts.open_cabinet import OpenCabinetExpert

MakePlan = Callable[..., Plan]


def failing(error: Exception) -> Any:
    def record(*arguments: object) -> None:
        raise error

    return record


@pytest.mark.parametrize(
    ("error", "kind"),
    [
        (np.linalg.LinAlgError("Singular matrix"), "LinAlgError"),
        (DivergedError({0: ("cabinet-0002", ("bad qpos",))}), "DivergedError"),
        (ZeroDivisionError("division by zero"), "ZeroDivisionError"),
    ],
)
def test_faults_of_an_episode_are_failed_attempts_and_are_counted(
    plan: MakePlan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception, kind: str
) -> None:
    monkeypatch.setattr(module, "record", failing(error))
    heard: list[module.Attempt] = []
    (entry,) = collect(plan(objects=["cabinet-0002"]), tmp_path, on_attempt=heard.append).files.values()
    assert [attempt.fault for attempt in heard] == [f"{kind}: {error}"] * 4
    (count,) = entry.targets
    assert (count.attempts, count.successes, count.gave_up, count.faults) == (4, 0, True, {kind: 4})
    with DemoFile(tmp_path / "cabinet-0002.h5") as file:
        assert file.header.targets == entry.targets


def test_an_action_that_is_none_is_a_failed_attempt(
    plan: MakePlan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    act, calls = OpenCabinetExpert.act, []

    def once_nan(self: OpenCabinetExpert, *arguments: Any) -> np.ndarray:
        calls.append(None)
        action = act(self, *arguments)
        return action * np.nan if len(calls) == 10 else action

    monkeypatch.setattr(OpenCabinetExpert, "act", once_nan)
    (entry,) = collect(plan(objects=["cabinet-0002"], per_object=1), tmp_path).files.values()
    (count,) = entry.targets
    assert (count.attempts, count.successes, count.faults) == (2, 1, {"FloatingPointError": 1})
    assert verify(tmp_path)[0].faults == ()


def test_other_errors_name_the_episode(plan: MakePlan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    episode = "object cabinet-0002, target link_0, level 0"
    monkeypatch.setattr(module, "record", failing(StateError("of another task")))
    with pytest.raises(PolicyError, match=f"^{episode}: of another task$"):
        collect(plan(objects=["cabinet-0002"]), tmp_path)
    monkeypatch.setattr(module, "record", failing(KeyError("grip")))
    with pytest.raises(KeyError) as caught:
        collect(plan(objects=["cabinet-0002"]), tmp_path)
    assert caught.value.__notes__ == [episode]
