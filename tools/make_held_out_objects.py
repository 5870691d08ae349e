"""Make objects of the families of `ood`: `python tools/make_held_out_objects.py --task PushChair --out chairs`.

The catalogue has 12 objects of each category of families that no other object belongs to. These are more of them,
of random streams that the catalogue never uses: nobody has met them, nothing was chosen by them. `objects.yaml`
lists those that the task can use, for `artiskill evaluate --objects`.
"""

import argparse
import sys
from pathlib import Path

from artiskill.assets.generators import generate
from artiskill.assets.names import parse_generated
from artiskill.errors import ArtiSkillError
from artiskill.tasks.registry import make_task
from make_rolled_cabinets import write_folders

LIST = "objects.yaml"


def main(arguments: list[str]) -> int:
    """Write the folders; the exit status is 2 if what is asked is not legal."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--task", required=True, help="that shall use them")
    parser.add_argument("--seeds", default="0..24", help="FIRST..LAST (default: %(default)s)")
    parser.add_argument("--out", type=Path, required=True, help="folder")
    options = parser.parse_args(arguments)
    try:
        names = make_folders(options.task, options.seeds, options.out)
    except ArtiSkillError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(f"{len(names)} objects: {options.out / LIST}")
    return 0


def make_folders(task_name: str, seeds: str, out: Path) -> list[str]:
    """Write a folder for each object that the task can use, and the list of them.

    Args:
        task_name: name of the task.
        seeds: FIRST..LAST, of objects of its category.
        out: folder.

    Returns:
        Names of the folders, in the order of the list.

    Raises:
        ArtiSkillError: an unknown task, illegal seeds; a folder holds something else, or cannot be written.
    """
    task = make_task(task_name)
    found = parse_generated(f"generated:{task.category}:{seeds}")
    assert found is not None, "it begins so"
    category, numbers = found
    made = (generate(category, seed, f"held-out-{category}-{seed}", held_out=True, fresh=True) for seed in numbers)
    usable = (one for one in made if task.targets(one))
    return write_folders(usable, out / LIST, f"{category} objects of held-out families, for {task_name}")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
