"""The type that every object takes: its order, its look-ups and its digest."""

import dataclasses
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from artiskill.assets.articulated_object import (
    ArticulatedObject,
    CollisionShape,
    Handle,
    Joint,
    Link,
    Material,
    VisualMesh,
)
from artiskill.errors import AssetError, UnknownNameError
from artiskill.geometry.primitives import box

IDENTITY = np.array((1.0, 0.0, 0.0, 0.0))


def a_link(name: str, parent: int, joint: Joint | None = None) -> Link:
    mesh = box((0.1, 0.2, 0.3))
    texture = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)
    mesh = dataclasses.replace(mesh, uvs=np.zeros((len(mesh.vertices), 2), dtype=np.float32))
    return Link(
        name=name,
        parent=parent,
        position=np.zeros(3),
        quaternion=IDENTITY.copy(),
        joint=joint,
        visuals=(VisualMesh(mesh, Material("oak", (0.5, 0.4, 0.3, 1.0), texture), "frame"),),
        collisions=(
            CollisionShape("box", (0.1, 0.2, 0.3), np.zeros(3), IDENTITY.copy(), part="frame"),
            CollisionShape("hull", (), np.zeros(3), IDENTITY.copy(), mesh.vertices.copy(), "frame"),
        ),
        density_kg_m3=500.0,
        surface_points=np.zeros((4, 3)),
    )


def a_joint(name: str, kind: Any = "prismatic") -> Joint:
    return Joint(name, kind, np.array((-1.0, 0.0, 0.0)), np.zeros(3), (0.0, 0.4))


def a_handle(link: str) -> Handle:
    poses = np.stack((IDENTITY, IDENTITY))
    return Handle(link, "bar", np.zeros((5, 3)), np.zeros((6, 4)), np.zeros((2, 3)), poses, 0.01, True)


def an_object(**changes: Any) -> ArticulatedObject:
    """A base, a drawer with a handle, a rigid rail, a door with two handles, a drawer without any."""
    links = (
        a_link("base", -1),
        a_link("link_0", 0, a_joint("joint_0")),
        a_link("rail", 1),
        a_link("link_1", 0, a_joint("joint_1", "revolute")),
        a_link("link_2", 2, a_joint("joint_2")),
    )
    values: dict[str, Any] = {
        "id": "thing",
        "category": "cabinet",
        "links": links,
        "handles": (a_handle("link_1"), a_handle("link_0"), a_handle("link_1")),
        "bounds": np.array(((-1.0, -1.0, 0.0), (1.0, 1.0, 2.0))),
        "metadata": {"family": "plain", "size": {"height_m": 2.0, "rows": [1, 2]}},
    }
    return ArticulatedObject(**(values | changes))


@pytest.mark.parametrize(
    ("metadata", "family"),
    [
        ({"family": "sideboard", "model_category": "Table", "source": "mine"}, "sideboard"),
        ({"model_category": "Table", "source": "mine"}, "Table"),
        ({"source": "mine"}, "mine"),
        ({}, "unknown"),
    ],
)
def test_families(metadata: dict[str, str], family: str) -> None:
    assert an_object(metadata=metadata).family == family


def test_joints_belong_to_links() -> None:
    assert an_object().jointed_links == (1, 3, 4)


def test_targets_have_the_joint_and_a_handle() -> None:
    thing = an_object()
    assert thing.target_links("prismatic") == ("link_0",)
    assert thing.target_links("revolute") == ("link_1",)
    assert an_object(handles=()).target_links("prismatic") == ()


def test_handles_of_a_link() -> None:
    thing = an_object()
    assert thing.handles_of("link_1") == (thing.handles[0], thing.handles[2])
    assert thing.handles_of("base") == ()


def test_links_by_name() -> None:
    thing = an_object()
    assert [thing.link_index(link.name) for link in thing.links] == [0, 1, 2, 3, 4]
    with pytest.raises(
        UnknownNameError, match=r"unknown link 'link_9'; did you mean 'link_.'.*\(object 'thing'\)"
    ):
        thing.link_index("link_9")


@pytest.mark.parametrize(
    "parents", [(0, 0), (-1, -1), (-1, 1), (-1, 2, 0), (-1, -2)], ids=["no root", "two", "self", "later", "before"]
)
def test_parents_stand_before_children(parents: tuple[int, ...]) -> None:
    links = tuple(a_link(f"l{i}", parent) for i, parent in enumerate(parents))
    with pytest.raises(AssetError, match=r"object 'thing': link 'l\d' must stand after its parent"):
        an_object(links=links, handles=())


def test_link_names_are_unique() -> None:
    with pytest.raises(AssetError, match="two links share a name"):
        an_object(links=(a_link("a", -1), a_link("a", 0)), handles=())


def test_handles_belong_to_links_of_the_object() -> None:
    with pytest.raises(AssetError, match=r"object 'thing': a handle's link 'link_7' is none of"):
        an_object(handles=(a_handle("link_7"),))


@pytest.mark.parametrize("name", ["40147", "generated-7", "cabinet-0005", "my_cabinet.v2"])
def test_legal_ids(name: str) -> None:
    assert an_object(id=name).id == name


@pytest.mark.parametrize("name", ["", "a b", "a/b", "a\n", "généré", "a:b", ".", "..", ".a", 5, None])
def test_illegal_ids(name: object) -> None:
    with pytest.raises(AssetError, match=re.escape(f"object id {name!r}: legal are letters, digits")):
        an_object(id=name)


def with_joint(**changes: Any) -> ArticulatedObject:
    joint = dataclasses.replace(a_joint("joint_0"), **changes)
    return an_object(links=(a_link("base", -1), a_link("link_0", 0, joint)), handles=())


@pytest.mark.parametrize(
    "limits", [(0.1, 0.1), (0.4, 0.0), (np.nan, 1.0), (0.0, np.nan), (0.0,), (0.0, "1"), None, (np.inf, np.inf)]
)
def test_illegal_limits(limits: Any) -> None:
    with pytest.raises(AssetError, match="'joint_0' of 'link_0': its limits must be two numbers") as caught:
        with_joint(limits=limits)
    assert repr(limits) in str(caught.value)


def test_only_hinges_move_without_end() -> None:
    with pytest.raises(AssetError, match="'joint_0' of 'link_0' is prismatic: its limits must be finite"):
        with_joint(limits=(0.0, np.inf))
    endless = with_joint(kind="revolute", limits=(-np.inf, np.inf)).links[1].joint
    assert endless is not None
    assert endless.limits == (-np.inf, np.inf)


@pytest.mark.parametrize(
    "axis", [(0.0, 0.0, 0.0), (0.0, 0.0, 1.1), (np.nan, 0.0, 1.0), (np.inf, 0.0, 0.0), (0.0, 1e300, 0.0), (1.0,)]
)
def test_illegal_axes(axis: tuple[float, ...]) -> None:
    with pytest.raises(AssetError, match="'joint_0' of 'link_0': its axis must be a finite vector") as caught:
        with_joint(axis=np.array(axis))
    assert repr(np.array(axis)) in str(caught.value)


def test_an_object_has_links() -> None:
    with pytest.raises(AssetError, match="object 'thing' has no links"):
        an_object(links=(), handles=())


def test_equal_content_has_an_equal_digest() -> None:
    assert an_object().content_hash == an_object().content_hash
    assert an_object(id="another").content_hash == an_object().content_hash
    reordered = {"size": {"rows": [1, 2], "height_m": 2.0}, "family": "plain"}
    assert an_object(metadata=reordered).content_hash == an_object().content_hash


def changed_values(value: Any) -> Iterator[Any]:
    """Every way to change one thing, at any depth, in a nest of dataclasses, tuples, arrays and plain values."""
    if dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            for new in changed_values(getattr(value, field.name)):
                yield Replacement(value, field.name, new)
    elif isinstance(value, np.ndarray):
        flat = value.astype(value.dtype, copy=True).reshape(-1)
        flat[-1] = flat[-1] + 1
        yield flat.reshape(value.shape)
        yield value[None]
    elif isinstance(value, tuple):
        yield (*value, value[-1]) if value else (1.0,)
        for i, item in enumerate(value):
            for new in changed_values(item):
                yield (*value[:i], new, *value[i + 1 :])
    else:
        yield changed_plain(value)


def changed_plain(value: Any) -> Any:
    if isinstance(value, bool):
        return not value
    if isinstance(value, int | float):
        return value + 1
    if isinstance(value, str):
        return value + "x"
    return value | {"more": 1} if isinstance(value, dict) else np.zeros(3)


@dataclasses.dataclass
class Replacement:
    """A dataclass instance with one field exchanged, without its checks: only its digest is asked for."""

    original: Any
    field: str
    new: Any

    def build(self) -> Any:
        made = object.__new__(type(self.original))
        for f in dataclasses.fields(self.original):
            object.__setattr__(made, f.name, getattr(self.original, f.name))
        object.__setattr__(made, self.field, built(self.new))
        return made


def built(value: Any) -> Any:
    if isinstance(value, Replacement):
        return value.build()
    return tuple(built(v) for v in value) if isinstance(value, tuple) else value


def test_any_change_changes_the_digest() -> None:
    thing = an_object(
        links=(a_link("base", -1), a_link("link_0", 0, a_joint("joint_0"))), handles=(a_handle("link_0"),)
    )
    digests = [built(change).content_hash for change in changed_values(thing) if change.field != "id"]
    assert len(digests) > 100
    assert thing.content_hash not in digests
    assert len(set(digests)) == len(digests), "two different changes share a digest"


def test_values_do_not_run_into_each_other() -> None:
    similar: list[dict[str, Any]] = [
        {"ab": "c"},
        {"a": "bc"},
        {"a": ("b", "c")},
        {"a": ("b",), "c": ()},
        {"a": {"b": 1}, "c": 2},
        {"a": {"b": 1, "c": 2}},
        {"a": np.zeros(2)},
        {"a": np.zeros((2, 1))},
        {"a": 1},
        {"a": 1.0},
        {"a": "1"},
        {"a": "", "b1": 2},
        {"a": "", "b": 12},
        {"a": (1, 23)},
        {"a": (12, 3)},
        {},
    ]
    assert len({an_object(metadata=metadata).content_hash for metadata in similar}) == len(similar)
