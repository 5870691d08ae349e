"""`artiskill objects`."""

import pytest

from artiskill.assets.catalog import list_objects
from artiskill.cli.main import main
from artiskill.tasks.registry import task_names


def test_every_task_has_objects(capsys: pytest.CaptureFixture[str]) -> None:
    for task in task_names():
        assert main(["objects", "--task", task]) == 0
        assert f"{list_objects(task=task)[-1]} " in capsys.readouterr().out


def test_only_implemented_tasks_are_accepted_and_offered(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("artiskill.tasks.registry.task_names", lambda: ("OpenCabinetDrawer",))
    for task in ("Foo", "OpenCabinetDoor"):
        assert main(["objects", "--task", task]) == 2
        shown = capsys.readouterr()
        assert shown.out == ""
        assert f"unknown task {task!r}" in shown.err
        assert "egal: OpenCabinetDrawer." in shown.err
