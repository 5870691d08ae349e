"""Policies that are commands: what is done again, and what is not."""

import os
from pathlib import Path

import pytest

from learning_tables.commands import finish


def test_a_policy_is_trained_again_only_by_another_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`artiskill train` says whether a run can go on so."""
    called: list[list[str]] = []

    def call(command: list[str], environment: os._Environ[str]) -> bool:
        called.append(command)
        return "--bad" not in command

    monkeypatch.setattr("learning_tables.commands.call", call)
    first, other, bad = (["train", "--seed", *last] for last in (("0",), ("1",), ("0", "--bad")))
    assert finish(tmp_path, None, {tmp_path / "report.json": ["evaluate"]})
    assert called == [], "it is not trained"
    for command in (first, first, other, first):
        assert finish(tmp_path, command, {})
    assert called == [first, other, first]
    assert not finish(tmp_path, bad, {tmp_path / "report.json": ["evaluate"]})
    assert called[-1] == bad, "nothing is measured"
    assert finish(tmp_path, None, {tmp_path / "report.json": ["evaluate"]})
    assert called[-1] == ["evaluate"]


def test_what_is_older_than_the_training_is_made_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another command trains another policy; its file and its report must not be the old one's."""
    called: list[str] = []

    def call(command: list[str], environment: os._Environ[str]) -> bool:
        called.append(command[0])
        if command[0] != "train":
            Path(command[1]).touch()
        return True

    monkeypatch.setattr("learning_tables.commands.call", call)
    files = {"export-policy": tmp_path / "policy.npz", "evaluate": tmp_path / "report.json"}
    results = {file: [name, str(file)] for name, file in files.items()}
    for _ in range(2):
        assert finish(tmp_path, ["train"], results)
    assert called == ["train", "export-policy", "evaluate"]
    for file in files.values():
        os.utime(file, ns=(0, 0))
    assert finish(tmp_path, ["train", "--seed", "1"], results)
    assert called[3:] == ["train", "export-policy", "evaluate"]
