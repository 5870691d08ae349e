"""Shares of points: by the names of masks, and as whole numbers."""

import pytest

from artiskill.tasks.point_shares import point_shares, shared_out
from artiskill.tasks.registry import make_task


@pytest.mark.parametrize(
    ("task", "shares"),
    [
        ("OpenCabinetDoor", (2, 5, 0, 1)),
        ("OpenCabinetDrawer", (4, 3, 0, 1)),
        ("PushChair", (0, 1)),
        ("MoveBucket", (0, 1)),
    ],
)
def test_shares_of_the_tasks(task: str, shares: tuple[int, ...]) -> None:
    assert point_shares(task, make_task(task).mask_names) == shares


def test_a_mask_of_another_task_is_seen_and_the_robot_is_not() -> None:
    seat, robot, others = point_shares("SitDown", ("seat", "robot"))
    assert robot == 0
    assert seat > others > 0


def test_points_are_whole_numbers() -> None:
    assert shared_out(128, (4, 3, 0, 1)) == [64, 48, 0, 16]
    assert shared_out(10, (1, 2)) == [3, 7]
    assert shared_out(7, (2, 5, 0, 1)) == [2, 4, 0, 1]


@pytest.mark.parametrize("had", [(64, 48, 0, 16), (32, 80, 0, 16), (3, 3, 1)])
def test_fewer_points_never_ask_for_more_of_a_mask_than_there_were(had: tuple[int, ...]) -> None:
    for points in range(1, sum(had) + 1):
        found = shared_out(points, had)
        assert sum(found) == points
        assert all(0 <= one <= most for one, most in zip(found, had, strict=True))
