"""Make objects of other sizes, for training and to measure policies on them.

`python tools/make_scaled_objects.py --objects train --task PushChair --scale 1.05 1.35 --out scaled/train`

Each object gets one random factor, by its name and `--seed`, whatever else is named. `objects.yaml` lists them,
for `artiskill train dagger --objects` and `artiskill evaluate --objects`. Training refuses those of `test` and
`ood`.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import object_of, resolve_objects
from artiskill.assets.scaling import FACTORS, scaled
from artiskill.errors import ArtiSkillError, AssetError
from make_rolled_cabinets import write_folders

LIST = "objects.yaml"


def main(arguments: list[str]) -> int:
    """Write the folders; the exit status is 2 if what is asked is not legal."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--objects", nargs="+", required=True, help="as `artiskill evaluate` takes them")
    parser.add_argument("--task", required=True, help="that shall use them")
    parser.add_argument(
        "--scale", nargs=2, type=float, required=True, metavar=("LOW", "HIGH"), help="range of the factors"
    )
    parser.add_argument("--seed", type=int, default=0, help="of the factors (default: %(default)s)")
    parser.add_argument("--out", type=Path, required=True, help="folder")
    options = parser.parse_args(arguments)
    try:
        names = make_folders(options.objects, options.task, options.scale, options.out, options.seed)
    except ArtiSkillError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(f"{len(names)} objects: {options.out / LIST}")
    return 0


def make_folders(objects: Sequence[str], task: str, scale: Sequence[float], out: Path, seed: int = 0) -> list[str]:
    """Write a folder for each object, of another size, and the list of them.

    Args:
        objects: as `resolve_objects` takes them.
        task: that can be done with them.
        scale: least and greatest factor.
        out: folder.
        seed: of the factors.

    Returns:
        Names of the folders, in the order of the list.

    Raises:
        ArtiSkillError: illegal objects, task, range or seed; a folder holds something else, or cannot be written.
    """
    low, high = scale
    if not FACTORS[0] <= low <= high <= FACTORS[1]:
        raise AssetError(
            f"--scale must be two numbers from {FACTORS[0]:g} to {FACTORS[1]:g}, LOW <= HIGH, not {low:g} {high:g}"
        )
    if seed < 0:
        raise AssetError(f"--seed must be at least 0, not {seed}")
    made = scaled_objects(objects, task, (low, high), seed)
    return write_folders(made, out / LIST, f"objects of {low:g} to {high:g} times their size, for {task}")


def scaled_objects(
    objects: Sequence[str], task: str, scale: tuple[float, float], seed: int = 0
) -> Iterator[ArticulatedObject]:
    """Yield the objects that `make_folders` writes."""
    for item in resolve_objects(objects, task=task):
        obj = object_of(item)
        rng = np.random.default_rng([seed, *obj.id.encode()])  # of its own
        rounded = round(float(rng.uniform(*scale)), 2)  # in names
        yield scaled(obj, min(max(rounded, scale[0]), scale[1]))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
