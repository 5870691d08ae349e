"""Folders in PartNet-Mobility's form, made of our own surfaces: what the importer's benchmark and tests read.

The data set may not be passed on, and two of its objects show little of what the other 2,300 hold. These show what
is hard for a convex decomposition: hundreds of meshes, carvings of 100,000 faces, frames and grids in one mesh,
sheets, faces drawn twice, open shells, faces turned inside out.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from artiskill.geometry.meshes import TriMesh, merge
from artiskill.geometry.primitives import box, cylinder, lathe, sphere, tube

Part = tuple[str, TriMesh]


@dataclass
class ToyLink:
    """A link of an object to be written; everything in our frame (z up, front to -x), in the file's units."""

    name: str
    parent: str
    joint: str
    parts: list[Part] = field(default_factory=list)
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    limits: tuple[object, object] | None = None


def write_object(folder: Path, category: str, links: list[ToyLink], names: str = "urdf") -> Path:
    """Write an object in the data set's form.

    Args:
        folder: made where it is missing.
        category: `Chair`, say.
        links: parents before children; the parent of the first is `base`.
        names: who names the parts: `urdf`, `annotations`, `links` (semantics.txt alone) or `none`.
    """
    (folder / "textured_objs").mkdir(parents=True, exist_ok=True)
    urdf, tree, mobility, semantics = ['<robot name="toy"><link name="base"/>'], [], [], []
    origins = {"base": np.zeros(3)}
    number = 0
    for link in links:
        origins[link.name] = np.array(link.origin, dtype=float)
        shift = _text(to_file(-origins[link.name]))
        urdf.append(f'<link name="{link.name}">')
        for part, mesh in link.parts:
            number += 1
            name = f' name="{part}-{number}"' if names == "urdf" else ""
            geometry = f'<geometry><mesh filename="textured_objs/original-{number}.obj"/></geometry>'
            urdf.append(f'<visual{name}><origin xyz="{shift}"/>{geometry}</visual>')
            tree.append({"id": number, "name": part, "objs": [f"original-{number}"]})
            mobility.append({"id": number, "parts": [{"id": number, "name": part}]})
            write_mesh(folder / "textured_objs" / f"original-{number}.obj", mesh)
        turn = ' rpy="1.570796326794897 0 -1.570796326794897"' if link.parent == "base" else ""
        place = _text(to_file(origins[link.name] - origins[link.parent]))
        limit = f'<limit lower="{link.limits[0]}" upper="{link.limits[1]}"/>' if link.limits else ""
        urdf.append(
            f'</link><joint name="joint_{link.name}" type="{link.joint}"><origin xyz="{place}"{turn}/>'
            f'<axis xyz="{_text(to_file(np.array(link.axis)))}"/><parent link="{link.parent}"/>'
            f'<child link="{link.name}"/>{limit}</joint>'
        )
        semantics.append(f"{link.name} hinge {link.parts[0][0] if link.parts else 'nothing'}")
    (folder / "mobility.urdf").write_text("\n".join([*urdf, "</robot>"]))
    (folder / "meta.json").write_text(json.dumps({"model_cat": category}))
    if names in ("urdf", "annotations"):
        (folder / "result.json").write_text(json.dumps(tree))
        (folder / "mobility_v2.json").write_text(json.dumps(mobility))
    if names == "links":
        (folder / "semantics.txt").write_text("\n".join(semantics))
    return folder


def to_file(points: np.ndarray) -> np.ndarray:
    """Points (..., 3) of our frame in the data set's: y up, front to +z."""
    return np.stack((-points[..., 1], points[..., 2], -points[..., 0]), axis=-1)


def write_mesh(path: Path, mesh: TriMesh) -> None:
    """A mesh of our frame as an OBJ file without materials."""
    lines = [f"v {_text(v)}" for v in to_file(mesh.vertices)]
    path.write_text("\n".join([*lines, *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.faces)]))


def _text(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)


# --- surfaces ---------------------------------------------------------------------------------------------------


def block(low: tuple[float, ...], high: tuple[float, ...], bevel: float = 0.0, cuts: int = 0) -> TriMesh:
    """A box between two corners, each of its triangles cut in four `cuts` times."""
    half = (np.array(high) - np.array(low)) / 2
    return subdivided(box(half, bevel), cuts).transformed(np.array(low) + half)


def subdivided(mesh: TriMesh, times: int) -> TriMesh:
    """The same surface with four times as many faces, again and again; vertices are shared."""
    for _ in range(times):
        edges = np.sort(np.concatenate([mesh.faces[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
        unique, index = np.unique(edges, axis=0, return_inverse=True)
        middle = (index.reshape(3, -1) + len(mesh.vertices)).T  # of the edges ab, bc, ca
        a, b, c = mesh.faces.T
        ab, bc, ca = middle.T
        faces = np.concatenate(
            [np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
        mesh = TriMesh(np.concatenate((mesh.vertices, mesh.vertices[unique].mean(axis=1))), faces)
    return mesh


def relief(
    depth: float, height: Callable[[np.ndarray, np.ndarray], np.ndarray], size: tuple[float, float], n: int
) -> TriMesh:
    """A closed plate in the plane y, z whose front (-x) is a relief, `height(y, z)`: 2 n^2 faces and more."""
    y, z = np.meshgrid(
        np.linspace(-0.5, 0.5, n + 1) * size[0], np.linspace(-0.5, 0.5, n + 1) * size[1], indexing="ij"
    )
    front = np.stack((-height(y, z), y, z), axis=-1).reshape(-1, 3)
    at = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    a, b, c, d = at[:-1, :-1].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel(), at[:-1, 1:].ravel()
    faces = [np.stack((a, c, b), axis=1), np.stack((a, d, c), axis=1)]
    border = np.concatenate((at[:-1, 0], at[-1, :-1], at[:0:-1, -1], at[0, :0:-1]))
    back = front[border] * (0, 1, 1) + (depth, 0, 0)
    first = len(front)
    here, there = np.arange(len(border)), np.roll(np.arange(len(border)), -1)
    faces += [np.stack((border[here], border[there], first + there), axis=1)]
    faces += [np.stack((border[here], first + there, first + here), axis=1)]
    centre = np.array([[depth, 0.0, 0.0]])
    last = first + len(border)
    faces += [np.stack((first + here, first + there, np.full(len(border), last)), axis=1)]
    return TriMesh(np.concatenate((front, back, centre)), np.concatenate(faces))


def panel(size: tuple[float, float], thickness: float, border: float, n: int) -> TriMesh:
    """A frame-and-panel door: a flat border, a groove, a raised field with sloping sides."""

    def height(y: np.ndarray, z: np.ndarray) -> np.ndarray:
        inside = np.minimum(size[0] / 2 - np.abs(y), size[1] / 2 - np.abs(z)) - border
        groove = -0.45 * thickness * (inside > 0) * np.clip(1 - (inside - border / 3) / (0.7 * border), 0, 1)
        return np.where(inside > 0, groove, 0.0)

    return relief(thickness, height, size, n)


def carving(size: tuple[float, float], thickness: float, n: int, seed: int) -> TriMesh:
    """A plate carved all over: smooth bumps at random."""
    waves = np.random.default_rng(seed).uniform(-1, 1, (12, 4))

    def height(y: np.ndarray, z: np.ndarray) -> np.ndarray:
        bumps = sum(np.sin(40 * (wy * y + wz * z) + 6 * p) * a for wy, wz, p, a in waves)
        return thickness * 0.15 * np.asarray(bumps)

    return relief(thickness, height, size, n)


def moulding(path: np.ndarray, profile: np.ndarray) -> TriMesh:
    """A closed profile swept along a path in the plane x, y, its corners mitred.

    Args:
        path: (P, 2) open polyline.
        profile: (Q, 2) outline, counter-clockwise: to the right of the path, and up.
    """
    path = np.asarray(path, dtype=float)
    along = np.diff(path, axis=0) / np.linalg.norm(np.diff(path, axis=0), axis=1, keepdims=True)
    right = np.stack((along[:, 1], -along[:, 0]), axis=1)
    first, last = right[:1], right[-1:]
    mitre = (right[:-1] + right[1:]) / (1 + np.einsum("ij,ij->i", right[:-1], right[1:]))[:, None]
    out = np.concatenate((first, mitre, last))
    rings = path[:, None, :] + out[:, None, :] * profile[None, :, :1]
    points = np.concatenate((rings, np.broadcast_to(profile[:, 1:], (*rings.shape[:2], 1))), axis=2)
    count, sides = points.shape[:2]
    s, t = np.arange(sides), (np.arange(sides) + 1) % sides
    base = (np.arange(count - 1) * sides)[:, None]
    a, b, c, d = base + s, base + t, base + t + sides, base + s + sides
    faces = [np.stack((a, c, b), axis=-1).reshape(-1, 3), np.stack((a, d, c), axis=-1).reshape(-1, 3)]
    flat, ends = points.reshape(-1, 3), []
    for ring, turn in ((0, 1), (count - 1, -1)):
        ends.append(points[ring].mean(axis=0))
        centre = len(flat) + len(ends) - 1
        cap = np.stack((ring * sides + s, ring * sides + t, np.full(sides, centre)), axis=1)
        faces.append(cap[:, ::turn])
    return TriMesh(np.concatenate((flat, ends)), np.concatenate(faces))


OGEE = np.array(
    [
        (0.0, 0.0),
        (0.02, 0.0),
        (0.035, 0.01),
        (0.04, 0.03),
        (0.05, 0.045),
        (0.07, 0.05),
        (0.08, 0.06),
        (0.08, 0.075),
        (0.06, 0.08),
        (0.0, 0.08),
    ]
)


def fine_ogee(points: int) -> np.ndarray:
    """The profile of a cornice with so many points on each of its sides."""
    ends = np.roll(OGEE, -1, axis=0)
    share = np.linspace(0, 1, points, endpoint=False)[None, :, None]
    return (OGEE[:, None] + share * (ends - OGEE)[:, None]).reshape(-1, 2)


def bow(width: float, reach: float, radius: float, segments: int = 16, rings: int = 40) -> TriMesh:
    """A bow handle: a round bar bent to the front (-x), its ends at x = 0, along y."""
    t = np.linspace(0, np.pi, rings)
    return tube(np.stack((-reach * np.sin(t) ** 0.5, width / 2 * np.cos(t), 0 * t), axis=1), radius, segments)


def leg(height: float, radius: float, segments: int = 48) -> TriMesh:
    """A turned leg with beads and coves."""
    z = np.linspace(0, 1, 40)
    swell = radius * (0.7 + 0.25 * np.sin(9 * z) * np.cos(25 * z))
    return lathe([(0.0, 0.0), *zip(swell, z * height, strict=True), (0.0, height)], segments)


def doubled(mesh: TriMesh, gap: float = 0.0) -> TriMesh:
    """Every face a second time, turned over, moved by a gap along x: as many exporters draw sheets."""
    return merge((mesh, TriMesh(mesh.vertices + np.array((gap, 0.0, 0.0)), mesh.faces[:, ::-1])))


def disturbed(mesh: TriMesh, seed: int, drop: float = 0.0) -> TriMesh:
    """Half of the faces turned inside out, some left out: an open shell without an inside."""
    rng = np.random.default_rng(seed)
    turned = np.where(rng.random(len(mesh.faces))[:, None] < 0.5, mesh.faces[:, ::-1], mesh.faces)
    return TriMesh(mesh.vertices, turned[rng.random(len(turned)) >= drop])


def shell(low: tuple[float, ...], high: tuple[float, ...], n: int) -> TriMesh:
    """A box of sheets without thickness, open at the top; n x n squares on each side."""
    lo, hi = np.array(low), np.array(high)
    axes = [(0, 1, 2, 0.0), (1, 2, 0, 0.0), (1, 2, 0, 1.0), (0, 2, 1, 0.0), (0, 2, 1, 1.0)]
    u, v = (g.ravel() for g in np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1), indexing="ij"))
    at = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    a, b, c, d = at[:-1, :-1].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel(), at[:-1, 1:].ravel()
    sheets = []
    for first, second, fixed, value in axes:
        points = np.empty((len(u), 3))
        points[:, first], points[:, second], points[:, fixed] = u, v, value
        sheets.append(
            TriMesh(lo + points * (hi - lo), np.concatenate((np.stack((a, b, c), 1), np.stack((a, c, d), 1))))
        )
    return merge(sheets)


# --- objects ----------------------------------------------------------------------------------------------------

W, D, H = 0.6, 0.35, 0.75  # half extents of the large cabinets


def _moved(mesh: TriMesh, *place: float) -> TriMesh:
    return mesh.transformed(place)


def _joint(name: str, kind: str, parts: list[Part], side: float = 0.0) -> ToyLink:
    """A drawer, or a door hung at y = `side` of the front."""
    if kind == "prismatic":
        return ToyLink(name, "link_0", kind, parts, axis=(-1, 0, 0), limits=(0, 0.5))
    return ToyLink(name, "link_0", kind, parts, (-D, side, 0), (0, 0, -np.sign(side)), (0, 1.5))


def _drawer(y: float, z: float, half_y: float, half_z: float, cuts: int) -> list[Part]:
    """Front with a raised field, four boards, a bow handle: 7 meshes."""
    x0, x1 = -D, D - 0.06
    front = _moved(panel((2 * half_y, 2 * half_z), 0.03, 0.03, 36), x0 - 0.03, y, z)
    w, low, high = half_y - 0.03, z - half_z + 0.03, z + half_z - 0.05
    boards = [
        block((x0, y - w, low), (x1, y - w + 0.015, high), 0.003, cuts),
        block((x0, y + w - 0.015, low), (x1, y + w, high), 0.003, cuts),
        block((x1 - 0.015, y - w, low), (x1, y + w, high), 0.003, cuts),
        block((x0, y - w, low), (x1, y + w, low + 0.012), 0.0, cuts),
    ]
    handle = _moved(bow(0.22, 0.07, 0.012), x0 - 0.03, y, z)
    rose = _moved(merge([sphere(0.018).transformed((0, s * 0.11, 0)) for s in (-1, 1)]), x0 - 0.03, y, z)
    return [("drawer_front", front), *(("drawer_box", b) for b in boards), ("handle", handle), ("ornament", rose)]


def _door(y: float, z: float, half_y: float, half_z: float, side: float) -> list[Part]:
    """A frame of four mouldings, a panel, a carving, a bow handle upright, a key hole and hinges: 10 meshes."""
    x0 = -D
    outline = np.array([(-half_y, -half_z), (half_y, -half_z), (half_y, half_z), (-half_y, half_z)])
    rails = []
    for k in range(4):
        a, b = outline[k], outline[(k + 1) % 4]
        strip = moulding(np.stack((a, a + (b - a) / 2, b)), fine_ogee(30) * 0.35)
        turned = TriMesh(strip.vertices[:, [2, 0, 1]] * (-1, 1, 1), strip.faces)
        rails.append(("frame", _moved(turned, x0, y, z)))
    plate = _moved(panel((2 * half_y, 2 * half_z), 0.025, 0.05, 40), x0 - 0.0, y, z)
    ornament = _moved(carving((0.8 * half_y, 0.5 * half_z), 0.012, 40, 3), x0 - 0.012, y, z)
    handle = _moved(_upright(bow(0.2, 0.07, 0.012)), x0 - 0.02, y - np.sign(side) * (half_y - 0.06), z)
    hinges = [("hinge", _moved(cylinder(0.012, 0.04, 48), x0, side, z + s * 0.6 * half_z)) for s in (-1, 1)]
    hole = _moved(sphere(0.01, 32, 12), x0 - 0.02, y, z - 0.5 * half_z)
    return [*rails, ("door_surface", plate), ("ornament", ornament), ("handle", handle), *hinges, ("lock", hole)]


def _upright(mesh: TriMesh) -> TriMesh:
    return TriMesh(mesh.vertices[:, [0, 2, 1]], mesh.faces[:, ::-1])


def _carcass(cuts: int) -> list[Part]:
    boards = [
        block((-D, -W - 0.03, -H), (D, -W, H), 0.006, cuts),
        block((-D, W, -H), (D, W + 0.03, H), 0.006, cuts),
        block((-D, -W, H - 0.03), (D, W, H), 0.006, cuts),
        block((-D, -W, -H), (D, W, -H + 0.03), 0.006, cuts),
        block((D - 0.015, -W, -H + 0.03), (D, W, H - 0.03), 0.0, cuts),
        block((-D + 0.03, -W, 0.18), (D - 0.02, W, 0.2), 0.004, cuts),
        block((-D + 0.03, -0.01, -H + 0.03), (D - 0.02, 0.01, 0.18), 0.004, cuts),
    ]
    return [("frame", board) for board in boards]


def big_cabinet() -> list[ToyLink]:
    """Two doors, two drawers, cornice, turned legs, shelves, books, pots: 97 open meshes of 4,000 faces each."""
    around = np.array([(D, -W - 0.03), (-D, -W - 0.03), (-D, W + 0.03), (D, W + 0.03)])
    base = _carcass(4)
    for height, size in ((H, 1.0), (H + 0.07, 0.7), (-H - 0.05, 0.8), (0.19, 0.3)):
        profile = fine_ogee(40) * size
        base.append(("frame_moulding", _moved(moulding(around[::-1], profile), 0, 0, height)))
    for sx in (-1, 1):
        for sy in (-1, 1):
            base.append(("leg", _moved(leg(0.2, 0.06), sx * (D - 0.07), sy * (W - 0.05), -H - 0.2)))
    for k in range(6):
        shelf = block((-D + 0.05, -W + 0.01, -0.55 + 0.12 * k), (D - 0.03, -0.02, -0.54 + 0.12 * k), 0.002, 4)
        base.append(("shelf", shelf))
    rng = np.random.default_rng(5)
    y = 0.04
    for _ in range(16):
        thick, tall = rng.uniform(0.012, 0.02), rng.uniform(0.16, 0.3)
        base.append(("book", _moved(_book(thick, tall, 0.2), 0.05, y, -0.7)))
        y += 2 * thick + 0.004
    for k in range(12):
        pot = lathe(
            [(0.0, 0.0), (0.03, 0.0), (0.045, 0.04), (0.03, 0.09), (0.026, 0.09), (0.04, 0.04), (0.0, 0.01)], 64
        )
        base.append(
            ("ornament", _moved(subdivided(pot, 1), -0.1 + 0.1 * (k % 3), -0.4 + 0.2 * (k // 3), H + 0.05))
        )
    for k in range(14):
        angle = 2 * np.pi * k / 14
        scroll = _scroll(0.05).transformed((-D - 0.02, 0.9 * W * np.cos(angle), H + 0.17 + 0.05 * np.sin(angle)))
        base.append(("ornament", scroll))
    moving = [
        _joint("link_1", "revolute", _door(-0.3, -0.26, 0.29, 0.42, -0.59), -0.59),
        _joint("link_2", "revolute", _door(0.3, -0.26, 0.29, 0.42, 0.59), 0.59),
        _joint("link_3", "prismatic", _drawer(-0.3, 0.45, 0.29, 0.24, 3)),
        _joint("link_4", "prismatic", _drawer(0.3, 0.45, 0.29, 0.24, 3)),
    ]
    links = [ToyLink("link_0", "base", "fixed", base), *moving]
    for number, link in enumerate(links):  # of the data set's meshes, few are watertight
        link.parts = [(part, disturbed(mesh, 100 * number + k, 0.01)) for k, (part, mesh) in enumerate(link.parts)]
    return links


def _book(half_thick: float, tall: float, deep: float) -> TriMesh:
    """A cover bent round a block of pages that lies deeper: concave at three sides."""
    cover = [
        block((-deep / 2, s * half_thick - 0.0015, 0), (deep / 2, s * half_thick + 0.0015, tall), 0, 3)
        for s in (-1, 1)
    ]
    pages = block(
        (-deep / 2 + 0.004, -half_thick + 0.0015, 0.004),
        (deep / 2 - 0.004, half_thick - 0.0015, tall - 0.004),
        0,
        3,
    )
    back = block((-deep / 2 - 0.004, -half_thick, 0), (-deep / 2, half_thick, tall), 0.001, 3)
    return merge((*cover, pages, back))


def _scroll(radius: float, turns: float = 2.2) -> TriMesh:
    """A spiral of round bar."""
    t = np.linspace(0.15, 1, 90)
    angle = 2 * np.pi * turns * t
    return tube(np.stack((0 * t, radius * t * np.cos(angle), radius * t * np.sin(angle)), axis=1), 0.006, 16)


def hundreds() -> list[ToyLink]:
    """A cabinet of 300 small meshes: sheets, doubled faces, open shells, faces turned inside out."""
    base = [("frame", disturbed(doubled(block(*corners), 0.0005), k)) for k, corners in enumerate(_sheets())]
    rng = np.random.default_rng(1)
    for k in range(240):
        y, z = rng.uniform(-0.5, 0.5), rng.uniform(-0.7, 0.1)
        kind = k % 4
        if kind == 0:
            mesh = disturbed(shell((-0.2, y, z), (0.1, y + 0.12, z + 0.09), 6), k)
        elif kind == 1:
            mesh = doubled(subdivided(sphere(0.04, 24, 12), 0).transformed((0.0, y, z)), 0.002)
        elif kind == 2:
            mesh = disturbed(bow(0.2, 0.08, 0.01).transformed((-0.1, y, z)), k, drop=0.1)
        else:
            mesh = disturbed(carving((0.2, 0.1), 0.01, 16, k).transformed((0.1, y, z)), k, drop=0.05)
        base.append(("things", mesh))
    drawers = []
    for k in range(6):
        z = 0.25 + 0.08 * k
        parts: list[Part] = [("drawer_front", block((-D - 0.02, -W, z), (-D, W, z + 0.07)))]
        parts += [
            ("drawer_box", disturbed(shell((-D, -W + 0.02, z + 0.01), (D - 0.05, W - 0.02, z + 0.06), 12), k))
        ]
        parts += [("handle", disturbed(bow(0.2, 0.06, 0.008).transformed((-D - 0.02, 0, z + 0.035)), k))]
        parts += [("ornament", _scroll(0.02).transformed((-D - 0.03, s * 0.07, z + 0.035))) for s in range(2, 8)]
        drawers.append(_joint(f"link_{k + 1}", "prismatic", parts))
    return [ToyLink("link_0", "base", "fixed", base), *drawers]


def _sheets() -> list[tuple[tuple[float, ...], tuple[float, ...]]]:
    t = 0.001
    return [
        ((-D, -W - t, -H), (D, -W, H)),
        ((-D, W, -H), (D, W + t, H)),
        ((-D, -W, H), (D, W, H + t)),
        ((-D, -W, -H - t), (D, W, -H)),
        ((D, -W, -H), (D + t, W, H)),
        ((-D, -W, 0.2), (D, W, 0.2 + t)),
    ]


def dense() -> list[ToyLink]:
    """Few meshes of very many faces: a carved back of 100,000, louvres, a lattice and a net in one mesh each."""
    base = _carcass(3)
    base.append(("ornament", _moved(carving((1.0, 0.3), 0.03, 224, 1), -D - 0.03, 0, H + 0.2)))
    net = [block((-D + 0.1, -W + 0.03 * k, 0.25), (-D + 0.11, -W + 0.03 * k + 0.004, 0.7)) for k in range(40)]
    net += [block((-D + 0.1, -W, 0.25 + 0.03 * k), (-D + 0.11, W, 0.254 + 0.03 * k)) for k in range(15)]
    base.append(("net", merge(net)))
    slat = box((0.012, 0.26, 0.003))
    lean = (np.cos(0.4), 0, np.sin(0.4), 0)
    slats = [slat.transformed((-D - 0.012, -0.3, -0.64 + 0.016 * k), lean) for k in range(50)]
    border = [block((-D - 0.025, -0.59 + 0.55 * k, -0.7), (-D, -0.56 + 0.55 * k, 0.17)) for k in range(2)]
    louvre: list[Part] = [("door_surface", merge((*slats, *border)))]
    louvre.append(("handle", _moved(_upright(bow(0.2, 0.07, 0.012, 32, 160)), -D - 0.02, -0.06, -0.2)))
    carved: list[Part] = [("door_surface", _moved(carving((0.58, 0.86), 0.02, 120, 7), -D - 0.02, 0.3, -0.26))]
    carved.append(("handle", _moved(_upright(bow(0.2, 0.07, 0.012, 32, 160)), -D - 0.02, 0.06, -0.2)))
    return [
        ToyLink("link_0", "base", "fixed", base),
        _joint("link_1", "revolute", louvre, -0.59),
        _joint("link_2", "revolute", carved, 0.59),
    ]


OBJECTS: dict[str, Callable[[], list[ToyLink]]] = {
    "big_cabinet": big_cabinet,
    "hundreds": hundreds,
    "dense": dense,
}
