import pytest

import artiskill
from artiskill.demos.demos import PACK, Demos, load_demo_pack
from artiskill.demos.verify import differences, verify
from artiskill.errors import UnknownNameError
from artiskill.tasks.registry import task_names

REMAKE = "remake it: python tools/make_demo_pack.py"


@pytest.mark.parametrize("task", task_names())
def test_the_pack_fits_the_package(task: str) -> None:
    """Objects and tasks are those of this version, and one trajectory of each object comes out bit for bit."""
    demos = Demos(load_demo_pack(task).folder, check=True)
    assert len(demos.objects) == 3
    assert len(demos) == 12
    for file in demos.files():
        obj = file.load_object()
        env = file.make_env()
        trajectory = file.trajectory(0)
        assert trajectory.success
        assert differences(trajectory, env, obj) == "", REMAKE


@pytest.mark.slow
@pytest.mark.parametrize("task", task_names())
def test_all_of_the_pack(task: str) -> None:
    verdicts = verify(PACK / task)
    assert sum(verdict.exact for verdict in verdicts) == 12, (REMAKE, verdicts)


def test_it_is_small() -> None:
    assert sum(path.stat().st_size for path in PACK.rglob("*")) < 2_000_000


def test_names() -> None:
    assert artiskill.load_demo_pack is load_demo_pack
    with pytest.raises(UnknownNameError, match="unknown task 'PushChairs'; did you mean 'PushChair'"):
        load_demo_pack("PushChairs")
