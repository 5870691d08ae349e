"""Messages say what was given, what is legal and what is nearest; built-in `except` clauses keep working."""

import pickle

import pytest

from artiskill import errors


def test_unknown_name_offers_the_nearest() -> None:
    error = errors.UnknownNameError("task", "OpenDrawr", ["OpenDoor", "OpenDrawer"])
    assert str(error) == ("unknown task 'OpenDrawr'; did you mean 'OpenDrawer'? Legal: OpenDoor, OpenDrawer.")


def test_unknown_name_without_anything_near() -> None:
    error = errors.UnknownNameError("split", "xyz", ["train", "test"], "(task 'A')")
    assert str(error) == "unknown split 'xyz'; legal: test, train. (task 'A')"


def test_unknown_name_takes_any_type_and_no_legal_names() -> None:
    assert str(errors.UnknownNameError("level", 3, [])) == "unknown level 3; legal: (none)."
    assert "Legal: 1, 10." in str(errors.UnknownNameError("level", "11", (1, 10)))


def test_long_lists_are_shortened() -> None:
    message = str(errors.UnknownNameError("object", "?", (f"cabinet-{i:02d}" for i in range(40))))
    assert "cabinet-11, ... (40 in all)" in message
    assert "cabinet-12" not in message
    exactly = str(errors.UnknownNameError("object", "?", (f"cabinet-{i:02d}" for i in range(12))))
    assert exactly.endswith("cabinet-11.")


@pytest.mark.parametrize(
    ("kind", "built_in"),
    [
        (errors.UnknownNameError, ValueError),
        (errors.ConfigError, ValueError),
        (errors.AssetError, ValueError),
        (errors.ActionError, ValueError),
        (errors.StateError, ValueError),
        (errors.PolicyError, RuntimeError),
        (errors.ClusterError, RuntimeError),
        (errors.ResetNeededError, RuntimeError),
        (errors.MissingExtraError, ImportError),
    ],
)
def test_each_error_is_also_the_expected_built_in(kind: type[Exception], built_in: type[Exception]) -> None:
    assert issubclass(kind, errors.ArtiSkillError)
    assert issubclass(kind, built_in)


def test_every_public_error_has_the_root() -> None:
    public = [
        value for value in vars(errors).values() if isinstance(value, type) and value.__module__ == errors.__name__
    ]
    assert len(public) >= 9
    assert all(issubclass(kind, errors.ArtiSkillError) for kind in public)


def test_missing_extra_says_how_to_get_it() -> None:
    assert str(errors.MissingExtraError("Importing PartNet-Mobility", "import")) == (
        "Importing PartNet-Mobility needs an optional dependency: pip install 'artiskill[import]'"
    )


@pytest.mark.parametrize(
    "error",
    [
        errors.UnknownNameError("object", "a", ["b"]),
        errors.MissingExtraError("MP4", "video"),
        errors.ConfigError("no"),
    ],
)
def test_errors_travel_between_processes(error: errors.ArtiSkillError) -> None:
    received = pickle.loads(pickle.dumps(error))
    assert type(received) is type(error)
    assert str(received) == str(error)
