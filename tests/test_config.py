"""YAML to frozen dataclasses and back, and every way in which that can go wrong."""

import dataclasses
from pathlib import Path
from typing import Literal

import pytest
import yaml

from artiskill.config import (
    CONFIG_DIR,
    check,
    dump_yaml,
    from_mapping,
    load_config,
    load_yaml,
    merge_overrides,
    to_mapping,
)
from artiskill.errors import ConfigError


@dataclasses.dataclass(frozen=True)
class Physics:
    timestep_s: float = 0.002
    substeps: int = 25
    solimp: tuple[float, ...] = (0.95, 0.99)

    def __post_init__(self) -> None:
        check(self.timestep_s > 0, f"timestep_s must be positive, not {self.timestep_s}")


@dataclasses.dataclass(frozen=True)
class Camera:
    name: str
    size: tuple[int, int] = (400, 160)


@dataclasses.dataclass(frozen=True)
class World:
    title: str
    physics: Physics = Physics()
    cameras: tuple[Camera, ...] = ()
    drives: dict[str, Physics] = dataclasses.field(default_factory=dict)
    backup: Physics | None = None
    weights: dict[str, float] = dataclasses.field(default_factory=dict)
    reach_m: tuple[float, float] = (0.0, 1.0)
    look: Literal["plain", "wooden"] = "plain"
    seed: int | None = None
    limit_s: float | None = None


@dataclasses.dataclass(frozen=True)
class SlowPhysics(Physics):
    """A subclass with a check of its own, which does not call the one of its base."""

    most_s: float = 1.0

    def __post_init__(self) -> None:
        check(self.timestep_s < self.most_s, f"timestep_s must lie below {self.most_s}, not {self.timestep_s}")


@dataclasses.dataclass(frozen=True)
class SlowWorld:
    physics: SlowPhysics


def build(text: str) -> World:
    return from_mapping(World, yaml.safe_load(text), source="world.yaml")


@pytest.mark.parametrize(
    ("timestep_s", "says"), [(2, r"timestep_s must lie below 1\.0"), (0, "timestep_s must be positive, not 0")]
)
def test_a_subclass_keeps_the_checks_of_its_base(timestep_s: float, says: str) -> None:
    with pytest.raises(ConfigError, match=rf"world\.yaml: physics\.{says}"):
        from_mapping(SlowWorld, {"physics": {"timestep_s": timestep_s}}, source="world.yaml")
    assert from_mapping(SlowWorld, {"physics": {"timestep_s": 0.5}}).physics.most_s == 1.0


def test_a_full_mapping() -> None:
    world = build(
        """
        title: kitchen
        physics: {timestep_s: 0.001, substeps: 5, solimp: [0.9, 1]}
        cameras: [{name: left}, {name: right, size: [64, 48]}]
        drives: {base: {timestep_s: 1}}
        backup: {substeps: 2}
        weights: {reach: 1, pull: 2.5}
        reach_m: [0, 2]
        """
    )
    assert world == World(
        title="kitchen",
        physics=Physics(0.001, 5, (0.9, 1.0)),
        cameras=(Camera("left"), Camera("right", (64, 48))),
        drives={"base": Physics(1.0)},
        backup=Physics(substeps=2),
        weights={"reach": 1.0, "pull": 2.5},
        reach_m=(0.0, 2.0),
    )
    assert isinstance(world.physics.solimp, tuple)
    assert isinstance(world.drives["base"].timestep_s, float)


def test_missing_keys_take_their_defaults() -> None:
    assert build("title: a") == World("a")


def test_optional_values() -> None:
    world = build("{title: a, seed: 3, limit_s: 2, backup: null}")
    assert (world.seed, world.limit_s, world.backup) == (3, 2.0, None)
    assert isinstance(world.limit_s, float)
    assert build("{title: a, limit_s: 1e-3}").limit_s == 0.001


def test_numbers_that_yaml_reads_as_text() -> None:
    physics = build("{title: a, physics: {timestep_s: 1e-3, solimp: [1e-2, 5]}}").physics
    assert physics.timestep_s == 0.001
    assert physics.solimp == (0.01, 5.0)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        (
            "{title: a, phisics: {}}",
            ["world.yaml: unknown key 'phisics'", "did you mean 'physics'?", "title, physics"],
        ),
        ("{title: a, physics: {timestep: 1}}", ["world.yaml: physics: unknown key 'timestep'", "'timestep_s'"]),
        ("{title: a, cameras: [{name: b}, {nam: c}]}", ["world.yaml: cameras[1]: unknown key 'nam'", "'name'"]),
        ("{title: a, drives: {base: {substep: 1}}}", ["world.yaml: drives.base: unknown key 'substep'"]),
        ("{title: a, backup: {substep: 1}}", ["world.yaml: backup: unknown key 'substep'", "'substeps'"]),
        ("{title: a, 7: b}", ["world.yaml: unknown key 7", "Legal: title"]),
        ("{physics: {}}", ["world.yaml", "'title' is missing"]),
        ("{title: a, cameras: [{size: [1, 2]}]}", ["world.yaml", "name' is missing"]),
        ("{title: 3}", ["world.yaml: 'title' must be str, not 3"]),
        ("{title: a, physics: {substeps: 2.5}}", ["'physics.substeps' must be int, not 2.5"]),
        ("{title: a, physics: fast}", ["world.yaml: physics must be a mapping", "'fast'"]),
        ("{title: a, physics: {timestep_s: quick}}", ["world.yaml", "a number was expected, not 'quick'"]),
        ("{title: a, physics: {timestep_s: true}}", ["a number was expected, not True"]),
        ("{title: a, physics: {timestep_s: [1]}}", ["timestep_s", "[1]"]),
        ("{title: a, physics: {solimp: 3}}", ["world.yaml: physics.solimp must be a list, not 3"]),
        ("{title: a, physics: {timestep_s: -1}}", ["world.yaml: physics.timestep_s must be positive, not -1"]),
        ("{title: a, cameras: 5}", ["world.yaml: cameras must be a list, not 5"]),
        ("{title: a, reach_m: 3}", ["world.yaml: reach_m must be a list of 2 values, not 3"]),
        ("{title: a, cameras: [left]}", ["cameras[0] must be a mapping", "'left'"]),
        ("{title: a, cameras: [{name: b, size: [1, 2, 3]}]}", ["size"]),
        ("{title: a, reach_m: [1, far]}", ["world.yaml: reach_m[1]: a number was expected, not 'far'"]),
        ("{title: a, weights: {reach: lots}}", ["weights.reach: a number was expected, not 'lots'"]),
        ("{title: a, look: metal}", ["'look' must be one of 'plain', 'wooden', not 'metal'"]),
        ("{title: a, look: wodden}", ["'look' must be one of", "not 'wodden'; did you mean 'wooden'?"]),
        ("{title: a, drives: {base: {timestep_s: 0}}}", ["world.yaml: drives.base.timestep_s must be positive"]),
        ("{title: a, cameras: [{name: b}, {name: 2}]}", ["'cameras[1].name' must be str, not 2"]),
        ("{title: a, seed: 1.5}", ["'seed' must be ", "int", "not 1.5"]),
        ("{title: a, seed: true}", ["seed: a number was expected, not True"]),
        ("{title: a, limit_s: soon}", ["limit_s: a number was expected, not 'soon'"]),
        ("{title: a, physics: {substeps: true}}", ["physics.substeps: a number was expected, not True"]),
    ],
)
def test_errors_name_the_key(text: str, parts: list[str]) -> None:
    with pytest.raises(ConfigError) as caught:
        build(text)
    for part in parts:
        assert part in str(caught.value)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"cannot read config file .*nowhere\.yaml.*No such file"):
        load_yaml(tmp_path / "nowhere.yaml")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"a: [1, 2", "is not valid YAML"),
        (b"- 1\n- 2", "must hold a mapping of keys to values, not list"),
        (b"", "must hold a mapping of keys to values, not NoneType"),
        (b"title: \xff\xfe", "is not valid YAML"),
        (b"title: a\x00b", "is not valid YAML"),
    ],
)
def test_a_file_that_is_no_mapping(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "odd.yaml"
    path.write_bytes(content)
    with pytest.raises(ConfigError, match=message) as caught:
        load_yaml(path)
    assert "odd.yaml" in str(caught.value)


def test_overrides_reach_any_depth_and_leave_the_original_alone() -> None:
    data = {"title": "a", "physics": {"substeps": 2, "timestep_s": 0.1}}
    merged = merge_overrides(data, {"physics.substeps": 3, "weights.reach": 1.0, "physics": {"timestep_s": 0.2}})
    assert merged == {"title": "a", "physics": {"substeps": 3, "timestep_s": 0.2}, "weights": {"reach": 1.0}}
    assert data == {"title": "a", "physics": {"substeps": 2, "timestep_s": 0.1}}


def test_overrides_replace_what_is_no_mapping() -> None:
    assert merge_overrides({"a": [1, 2]}, {"a": [3]}) == {"a": [3]}
    assert merge_overrides({"a": 1}, {"a.b.c": 2}) == {"a": {"b": {"c": 2}}}
    assert merge_overrides({"a": {"b": 1}}, {"a": None}) == {"a": None}


def test_loading_with_overrides(tmp_path: Path) -> None:
    path = tmp_path / "world.yaml"
    path.write_text("title: a\nphysics:\n  substeps: 2\n")
    world = load_config(World, path, {"physics.timestep_s": "5e-4", "title": "b"})
    assert world == World("b", Physics(0.0005, 2))
    with pytest.raises(ConfigError, match=r"^config: physics: unknown key 'timestep'"):
        load_config(World, path, {"physics.timestep": 1})


def test_an_error_is_blamed_on_whose_value_it_is(tmp_path: Path) -> None:
    path = tmp_path / "world.yaml"
    path.write_text("title: a\nphysics:\n  substeps: 2\n")
    with pytest.raises(ConfigError, match=r"^config: 'physics\.substeps' must be int"):
        load_config(World, path, {"physics.substeps": "many"})
    path.write_text("title: a\nphysics:\n  substeps: many\n")
    for given in (None, {}, {"title": "b"}):
        with pytest.raises(ConfigError, match=r"^world\.yaml: 'physics\.substeps' must be int"):
            load_config(World, path, given)
    assert load_config(World, path, {"physics.substeps": 3}).physics.substeps == 3


def test_round_trip(tmp_path: Path) -> None:
    world = World(
        "a", Physics(1e-5, 3, (0.1,)), (Camera("b", (1, 2)),), {"c": Physics()}, None, {"d": 1e-7}, (0.0, 3.5)
    )
    text = dump_yaml(world)
    assert list(yaml.safe_load(text)) == [f.name for f in dataclasses.fields(World)]
    path = tmp_path / "saved.yaml"
    path.write_text(text)
    assert load_config(World, path) == world
    assert to_mapping(world)["cameras"] == [{"name": "b", "size": [1, 2]}]


@pytest.mark.parametrize(
    "path", sorted(CONFIG_DIR.rglob("*.yaml")), ids=lambda path: str(path.relative_to(CONFIG_DIR))
)
def test_shipped_files_are_mappings(path: Path) -> None:
    assert load_yaml(path)
