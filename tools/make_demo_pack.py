"""Make the package's demo pack anew: `python tools/make_demo_pack.py`; needed whenever tasks or objects change.

For each task three training objects, far apart in the catalogue, and a few trajectories of each.
"""

import argparse
import shutil
import tempfile
from pathlib import Path

import artiskill
from artiskill.demos.collect import collect
from artiskill.demos.demos import PACK
from artiskill.demos.plan import CollectionOptions, make_plan
from artiskill.demos.verify import verify
from artiskill.tasks.registry import task_names

OBJECTS, PER_OBJECT = 3, 4
MOST_BYTES = 2_000_000


def main() -> None:
    """Collect into a temporary folder, verify, and put it in the old one's place."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--workers", type=int, default=2, help="processes (default: %(default)s)")
    workers = parser.parse_args().workers
    with tempfile.TemporaryDirectory() as folder:
        new = Path(folder) / "pack"
        for task in task_names():
            legal = artiskill.list_objects(split="train", task=task)
            objects = [legal[k * len(legal) // OBJECTS] for k in range(OBJECTS)]
            collect(make_plan(task, objects, CollectionOptions(per_object=PER_OBJECT)), new / task, workers)
            results = verify(new / task, workers)
            exact = sum(result.exact for result in results)
            if exact != OBJECTS * PER_OBJECT:
                raise SystemExit(f"{task}: {exact} of {OBJECTS * PER_OBJECT} trajectories could be verified")
            print(f"{task}: {', '.join(objects)}: {exact} trajectories", flush=True)
        size = sum(path.stat().st_size for path in new.rglob("*") if path.is_file())
        if size > MOST_BYTES:
            raise SystemExit(f"the pack takes {size} bytes, more than {MOST_BYTES}")
        shutil.rmtree(PACK, ignore_errors=True)
        shutil.copytree(new, PACK)
    print(f"{PACK}: {size} bytes")


if __name__ == "__main__":
    main()
