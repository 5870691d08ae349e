"""Small objects of boxes: sound ones, which tests then break in one way each."""

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace

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
from artiskill.assets.handles import handle_from_mesh
from artiskill.geometry.meshes import TriMesh, merge
from artiskill.geometry.primitives import box, sphere

IDENTITY = np.array((1.0, 0.0, 0.0, 0.0))
GREY = Material("grey", (0.5, 0.5, 0.5, 1.0))
Box = tuple[str, tuple[float, float, float], tuple[float, float, float]]  # part, centre, half extents


def mesh_of(centre: Sequence[float], half: Sequence[float]) -> TriMesh:
    return box(half).transformed(centre)


def touched(part: str, centre: Sequence[float], half: Sequence[float]) -> CollisionShape:
    return CollisionShape("box", tuple(half), np.asarray(centre, dtype=float), IDENTITY, part=part)


def make_link(
    name: str,
    parent: int,
    boxes: Sequence[Box],
    position: Sequence[float] = (0, 0, 0),
    joint: Joint | None = None,
    density: float = 600.0,
) -> Link:
    """A link that is touched exactly where it is drawn."""
    visuals = tuple(VisualMesh(mesh_of(c, h), GREY, part) for part, c, h in boxes)
    collisions = tuple(touched(part, c, h) for part, c, h in boxes)
    return Link(
        name, parent, np.asarray(position, float), IDENTITY, joint, visuals, collisions, density, np.zeros((1, 3))
    )


def slide(name: str, limits: tuple[float, float], axis: Sequence[float] = (-1, 0, 0)) -> Joint:
    return Joint(name, "prismatic", np.asarray(axis, float), np.zeros(3), limits)


def hinge(name: str, axis: Sequence[float], origin: Sequence[float], limits: tuple[float, float]) -> Joint:
    return Joint(name, "revolute", np.asarray(axis, float), np.asarray(origin, float), limits)


def with_link(obj: ArticulatedObject, name: str, **changes: object) -> ArticulatedObject:
    """The object with a link changed."""
    links = [replace(link, **changes) if link.name == name else link for link in obj.links]  # type: ignore[arg-type]
    return replace(obj, links=tuple(links))


def with_boxes(obj: ArticulatedObject, name: str, boxes: Sequence[Box], drawn: bool = True) -> ArticulatedObject:
    """The object with more boxes on a link."""
    link = obj.links[obj.link_index(name)]
    more = tuple(VisualMesh(mesh_of(c, h), GREY, part) for part, c, h in boxes) if drawn else ()
    shapes = tuple(touched(part, c, h) for part, c, h in boxes)
    return with_link(obj, name, visuals=(*link.visuals, *more), collisions=(*link.collisions, *shapes))


def cabinet(object_id: str = "drawer-cabinet", width_m: float = 0.5) -> ArticulatedObject:
    """A carcass on the ground with one hollow drawer, which has a bar to grip."""
    w, inner = width_m / 2, width_m / 2 - 0.02
    carcass: list[Box] = [
        ("frame", (0.2, 0, 0.25), (0.2, w, 0.01)),
        ("frame", (0.2, 0, 0.49), (0.2, w, 0.01)),
        ("frame", (0.2, -w + 0.01, 0.37), (0.2, 0.01, 0.11)),
        ("frame", (0.2, w - 0.01, 0.37), (0.2, 0.01, 0.11)),
        ("back", (0.39, 0, 0.37), (0.01, inner, 0.11)),
        ("plinth", (0.2, 0, 0.12), (0.19, w - 0.01, 0.12)),
    ]
    sides = inner - 0.005
    drawer: list[Box] = [
        ("drawer_front", (-0.012, 0, 0.37), (0.01, w, 0.12)),
        ("drawer_bottom", (0.18, 0, 0.27), (0.18, sides, 0.005)),
        ("drawer_side", (0.18, -sides + 0.006, 0.37), (0.18, 0.006, 0.095)),
        ("drawer_side", (0.18, sides - 0.006, 0.37), (0.18, 0.006, 0.095)),
        ("drawer_back", (0.354, 0, 0.37), (0.006, sides, 0.095)),
        *bar(0.008),
    ]
    links = (make_link("base", -1, carcass), make_link("link_0", 0, drawer, joint=slide("link_0_slide", (0, 0.3))))
    bounds = np.array(((-0.062, -w, 0), (0.4, w, 0.5)))
    return ArticulatedObject(object_id, "cabinet", links, (grip("link_0", bar(0.008), True),), bounds)


def bar(radius_m: float) -> list[Box]:
    """A horizontal bar in front of the drawer's front, on two posts."""
    return [
        ("handle", (-0.062 + radius_m, 0, 0.37), (radius_m, 0.07, radius_m)),
        ("handle", (-0.034, -0.06, 0.37), (0.012, 0.005, 0.005)),
        ("handle", (-0.034, 0.06, 0.37), (0.012, 0.005, 0.005)),
    ]


def grip(link: str, boxes: Sequence[Box], hookable: bool) -> Handle:
    mesh = merge(mesh_of(c, h) for _, c, h in boxes)
    return handle_from_mesh(link, "bar", mesh, np.array((-1.0, 0, 0)), np.random.default_rng(0), hookable)


def door_cabinet() -> ArticulatedObject:
    """An open box with one door, hinged at its left edge."""
    frame: list[Box] = [
        ("frame", (0.2, 0, 0.01), (0.2, 0.2, 0.01)),
        ("frame", (0.2, 0, 0.49), (0.2, 0.2, 0.01)),
        ("frame", (0.2, -0.19, 0.25), (0.2, 0.01, 0.23)),
        ("frame", (0.2, 0.19, 0.25), (0.2, 0.01, 0.23)),
    ]
    door: list[Box] = [("door_front", (0, -0.2, 0), (0.01, 0.2, 0.24))]
    joint = hinge("link_0_hinge", (0, 0, -1), (-0.01, 0, 0), (0, 1.8))
    links = (make_link("base", -1, frame), make_link("link_0", 0, door, (-0.012, 0.2, 0.25), joint))
    return ArticulatedObject("door-cabinet", "cabinet", links, (), np.array(((-0.022, -0.2, 0), (0.4, 0.2, 0.5))))


def chair(reach_m: float = 0.28, seat_height_m: float = 0.45) -> ArticulatedObject:
    """Four casters with trail and one ball each, a star, and a seat with a back that swivels."""
    star: list[Box] = [
        ("base", (0, 0, 0.1), (reach_m + 0.03, 0.02, 0.01)),
        ("base", (0, 0, 0.13), (0.02, reach_m + 0.03, 0.01)),
        ("base", (0, 0, 0.2), (0.03, 0.03, 0.05)),
    ]
    height = seat_height_m
    seat: list[Box] = [
        ("seat", (0, 0, height), (0.22, 0.22, 0.03)),
        ("back", (0.2, 0, height + 0.26), (0.02, 0.2, 0.2)),
        ("seat", (0, 0, (height + 0.22) / 2), (0.02, 0.02, (height - 0.28) / 2)),
    ]
    swivel = hinge("link_0_swivel", (0, 0, 1), (0, 0, 0), (-np.inf, np.inf))
    links = [
        make_link("base", -1, star, density=1500),
        make_link("link_0", 0, seat, joint=swivel, density=300),
    ]
    for k, (x, y) in enumerate(((1, 0), (0, 1), (-1, 0), (0, -1))):
        links += _caster(f"{k}", 2 + 2 * k, (reach_m * x, reach_m * y, 0.0))
    bounds = np.array(((-reach_m - 0.03, -reach_m - 0.03, 0), (reach_m + 0.03, reach_m + 0.03, height + 0.46)))
    return ArticulatedObject("chair", "chair", tuple(links), (), bounds, {"seat_height_m": height})


def _caster(name: str, index: int, place: tuple[float, float, float]) -> list[Link]:
    endless = (-np.inf, np.inf)
    fork = make_link(
        f"fork_{name}", 0, [("caster", (0, 0, 0.074), (0.012, 0.012, 0.006))], place,
        hinge(f"fork_{name}_swivel", (0, 0, 1), (0, 0, 0), endless), 2000,
    )  # fmt: skip
    ball = CollisionShape("sphere", (0.03,), np.zeros(3), IDENTITY, part="wheel")
    wheel = Link(
        f"wheel_{name}", index, np.array((0.02, 0, 0.03)), IDENTITY,
        hinge(f"wheel_{name}_roll", (0, 1, 0), (0, 0, 0), endless),
        (VisualMesh(sphere(0.03), GREY, "wheel"),), (ball,), 1000, np.zeros((1, 3)),
    )  # fmt: skip
    return [fork, wheel]


def bucket() -> ArticulatedObject:
    """A square bucket without a bail."""
    walls: list[Box] = [("wall", (0, 0, 0.004), (0.12, 0.12, 0.004))]
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        half = (0.004, 0.12, 0.12) if x else (0.12, 0.004, 0.12)
        walls.append(("wall", (0.116 * x, 0.116 * y, 0.128), half))
    return ArticulatedObject(
        "bucket", "bucket", (make_link("base", -1, walls, density=1000),), (),
        np.array(((-0.12, -0.12, 0), (0.12, 0.12, 0.248))),
    )  # fmt: skip


@pytest.fixture(scope="session")
def make() -> SimpleNamespace:
    """The functions above."""
    return SimpleNamespace(
        **{f.__name__: f for f in (cabinet, door_cabinet, chair, bucket, bar, grip, hinge, slide, touched)},
        with_link=with_link,
        with_boxes=with_boxes,
    )
