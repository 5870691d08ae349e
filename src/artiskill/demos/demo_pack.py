"""The demonstrations that come with the package: a few of every task, for first steps and tests."""

from pathlib import Path

from artiskill.demos.demos import Demos
from artiskill.errors import check_name
from artiskill.tasks.registry import task_names

PACK = Path(__file__).parent / "pack"


def load_demo_pack(task: str) -> Demos:
    """A few demonstrations of a task, of three training objects.

    Raises:
        UnknownNameError: no such task, or none of it in the pack.
        MissingExtraError: h5py is not installed, when a file is opened.
    """
    legal = [name for name in task_names() if (PACK / name).is_dir()]
    check_name("task", task, legal, "(of the demo pack)")
    return Demos(PACK / task)
