"""Make cabinets that lie on their side: `python tools/make_rolled_cabinets.py --seeds 0..299 --out rolled/train`.

Their hinges lie level, as those of flaps, which no generated cabinet has that policies may train on. Each is a
generated cabinet with a door, rolled by a quarter turn and held at a height where its doors can be reached. Its
hinges go no further than a flap's, but have no spring that holds them shut. With `--task OpenCabinetDrawer`, each
has a drawer, and is held where doors and drawers can be reached. `cabinets.yaml` lists them, for
`artiskill train dagger --objects`.
"""

import argparse
import itertools
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, JointKind, Link
from artiskill.assets.catalog import object_of, resolve_objects
from artiskill.config import dump_yaml
from artiskill.errors import ArtiSkillError
from artiskill.exports.export import export_object
from artiskill.files import atomic_write
from artiskill.geometry.rotations import quat_to_matrix

LIST = "cabinets.yaml"
DOORS = "OpenCabinetDoor"
# task -> the joints of the links whose handles can be reached
HANDLES: dict[str, tuple[JointKind, ...]] = {DOORS: ("revolute",), "OpenCabinetDrawer": ("revolute", "prismatic")}
SIDES = {"left": 1.0, "right": -1.0}  # the one of its own that it lies on -> sense of the turn about x
HANDLE_HEIGHT_M = (0.45, 1.15)  # mean of these handles, unless the cabinet stands on the floor and they are higher
LIMIT_DEG = (75.0, 95.0)  # of hinges, as `flap_limit_deg` of the generator


def main(arguments: list[str]) -> int:
    """Write the folders; the exit status is 2 if what is asked is not legal."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--seeds", default="0..299", help="of generated cabinets, FIRST..LAST (default: %(default)s)"
    )
    parser.add_argument(
        "--task", default=DOORS, choices=HANDLES, help="they have a target of (default: %(default)s)"
    )
    parser.add_argument("--both", action="store_true", help="on either side (default: on the one or the other)")
    parser.add_argument("--out", type=Path, required=True, help="folder")
    options = parser.parse_args(arguments)
    try:
        names = make_folders(options.seeds, options.out, options.both, options.task)
    except ArtiSkillError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(f"{len(names)} cabinets: {options.out / LIST}")
    return 0


def make_folders(seeds: str, out: Path, both: bool = False, task: str = DOORS) -> list[str]:
    """Write a folder for each generated cabinet that has doors, or drawers, and the list of them.

    Args:
        seeds: FIRST..LAST.
        out: folder.
        both: a cabinet lies on either side, a folder each; else on the left and on the right in turn.
        task: that they can be done with.

    Returns:
        Names of the folders, in the order of the list.

    Raises:
        ArtiSkillError: illegal seeds; a folder holds something else, or cannot be written.
    """
    return write_folders(rolled_cabinets(seeds, both, task), out / LIST, "generated cabinets on their side")


def rolled_cabinets(seeds: str, both: bool = False, task: str = DOORS) -> Iterator[ArticulatedObject]:
    """Yield the cabinets that `make_folders` writes, on their side."""
    found = resolve_objects([f"generated:cabinet:{seeds}"], task=task)
    for item, in_turn in zip(found, itertools.cycle(SIDES)):
        for side in SIDES if both else (in_turn,):
            yield roll(object_of(item), side, task)


def write_folders(objects: Iterable[ArticulatedObject], listed: Path, description: str) -> list[str]:
    """Write a folder for each object beside a list of them, which is written last; return the folders' names."""
    names = []
    for one in objects:
        export_object(one, "urdf", listed.parent / one.id)
        names.append(one.id)
    names.sort()
    with atomic_write(listed) as temporary:
        text = dump_yaml({"objects": [f"./{name}" for name in names], "description": description})
        temporary.write_text(text, encoding="utf-8")
    return names


def roll(cabinet: ArticulatedObject, side: str, task: str = DOORS) -> ArticulatedObject:
    """Return a generated cabinet that lies on its side, without the wall that it may have hung on."""
    seed, sense, half = int(cabinet.id.rpartition("-")[2]), SIDES[side], np.sqrt(0.5)
    rng = np.random.default_rng([seed, int(sense) + 1])  # another stream for each side
    assert not cabinet.links[0].position.any(), "the base's frame is the cabinet's"
    assert not any(link.parent for link in cabinet.links[1:]), "no link's parent is the wall"
    turn = np.array((half, sense * half, 0.0, 0.0))
    matrix = quat_to_matrix(turn)
    corners = np.array(list(itertools.product(*cabinet.bounds.T))) @ matrix.T
    low, high = corners.min(axis=0), corners.max(axis=0)
    to_floor = np.array((0.0, -(low[1] + high[1]) / 2, -low[2]))
    heights = [(place @ matrix.T + to_floor)[2] for place in _handles(cabinet, HANDLES[task])]
    up = np.array((0.0, 0.0, max(0.0, rng.uniform(*HANDLE_HEIGHT_M) - np.mean(heights))))
    base = replace(cabinet.links[0], position=to_floor + up, quaternion=turn)
    links = (base, *(_limited(link, rng) for link in cabinet.links[1:] if not link.is_wall))
    bounds = np.stack((low + to_floor, high + to_floor)) + up
    facts = {**cabinet.metadata, "lies_on": side}
    return ArticulatedObject(f"rolled-cabinet-{seed}-{side}", "cabinet", links, cabinet.handles, bounds, facts)


def _handles(cabinet: ArticulatedObject, kinds: Sequence[JointKind]) -> list[np.ndarray]:
    """Return the middles of the handles of a standing cabinet's links with such joints, (3,), in its frame."""
    links = {link.name: link for link in cabinet.links if link.joint is not None and link.joint.kind in kinds}
    return [links[one.link].position + one.points.mean(axis=0) for one in cabinet.handles if one.link in links]


def _limited(link: Link, rng: np.random.Generator) -> Link:
    """Return a link whose hinge, if it has one, goes no further than a flap's."""
    if link.joint is None or link.joint.kind != "revolute":
        return link
    low, high = link.joint.limits
    return replace(
        link, joint=replace(link.joint, limits=(low, min(high, float(np.deg2rad(rng.uniform(*LIMIT_DEG))))))
    )


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
