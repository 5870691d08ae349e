"""Groups of episodes: every episode has each trait once, and traits are those of its object and target."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import load_object
from artiskill.cli.main import main
from artiskill.errors import ConfigError
from artiskill.evaluation.evaluate import evaluate
from artiskill.evaluation.groups import Trait, group_episodes, traits_of
from artiskill.evaluation.report import write_report

DOORS, LEVELS = ["cabinet-0006", "cabinet-0086"], 3
SHORT = {"episode_steps": 2}


def turned(obj: ArticulatedObject, name: str) -> ArticulatedObject:
    """The object on its side, of another name."""
    half = np.sqrt(0.5)
    base = replace(obj.links[0], quaternion=np.array((half, half, 0.0, 0.0)))
    return replace(obj, id=name, links=(base, *obj.links[1:]))


def target_of(obj: ArticulatedObject, kind: str) -> str:
    return next(link.name for link in obj.links if link.joint is not None and link.joint.kind == kind)


def test_every_episode_has_each_trait_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report = evaluate("OpenCabinetDoor", "expert", DOORS, LEVELS)
    folder = write_report(report, tmp_path)
    groups = group_episodes(folder)
    assert {group.trait.name for group in groups} == {"family", "handle", "joint"}
    for name in ("family", "handle", "joint"):
        found = [episode for group in groups if group.trait.name == name for episode in group.episodes]
        assert sorted(map(repr, found)) == sorted(map(repr, report.episodes))
    level = next(group for group in groups if group.trait == ("joint", "level hinge"))
    assert {episode.object for episode in level.episodes} == {"cabinet-0086"}
    assert (level.objects, len(level.episodes)) == (1, LEVELS)
    assert level.stats.successes == next(
        row.stats.successes for row in report.rows if row.object == "cabinet-0086"
    )

    assert main(["report", "groups", str(folder)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any("level hinge" in line and f"{level.stats.successes}/{LEVELS}" in line for line in lines)


def test_the_least_successful_come_first(tmp_path: Path) -> None:
    cut = {"episode_steps": 62}  # ends some of the expert's episodes too early
    report = evaluate("OpenCabinetDrawer", "expert", ["cabinet-0002", "cabinet-0003"], 4, config=cut)
    assert 0 < report.success_rate < 1
    found = group_episodes(write_report(report, tmp_path))
    for name in ("family", "handle", "joint"):
        rates = [group.stats.success_rate for group in found if group.trait.name == name]
        assert rates == sorted(rates)


@pytest.mark.parametrize(
    ("name", "kind", "traits"),
    [
        ("cabinet-0092", "prismatic", {"family": "cup_chest", "handle": "cup", "joint": "slide"}),
        ("cabinet-0086", "revolute", {"family": "flap_cabinet", "joint": "level hinge"}),
        ("cabinet-0006", "revolute", {"joint": "upright hinge"}),
        ("chair-0044", "revolute", {"family": "pedestal"}),
        ("bucket-0004", "revolute", {"handle": "bail"}),
    ],
)
def test_traits_of_objects(name: str, kind: str, traits: dict[str, str]) -> None:
    obj = load_object(name)
    found = dict(traits_of(obj, target_of(obj, kind)))
    assert found | traits == found
    assert ("joint" in found) == (obj.category == "cabinet")
    assert ("handle" in found) == (obj.category != "chair")


def test_a_cabinet_on_its_side_has_other_hinges() -> None:
    standing = load_object("cabinet-0006")
    door = target_of(standing, "revolute")
    assert Trait("joint", "level hinge") in traits_of(turned(standing, "lying"), door)
    imported = replace(standing, metadata={"model_category": "StorageFurniture"})
    assert Trait("family", "StorageFurniture") in traits_of(imported, door)


def test_objects_are_those_of_the_report(tmp_path: Path) -> None:
    mine = replace(load_object("cabinet-0006"), id="mine")
    folder = write_report(evaluate("OpenCabinetDoor", "still", [mine], 1, config=SHORT), tmp_path)
    assert [group.objects for group in group_episodes(folder, [mine])] == [1, 1, 1]
    with pytest.raises(ConfigError, match=r"none of this package: name it.*--objects"):
        group_episodes(folder)
    with pytest.raises(ConfigError, match="'mine' is another one than the report's: its content hash is"):
        group_episodes(folder, [turned(mine, "mine")])
    with pytest.raises(ConfigError, match="'cabinet-0006' has no link 'lid'"):
        traits_of(load_object("cabinet-0006"), "lid")
