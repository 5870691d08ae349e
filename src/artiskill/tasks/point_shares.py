"""How the points of small clouds are shared out among a task's masks, where sampling is by `shares`.

By the paper's method two of three points lie in a mask, most of them on the robot, whose joints are known anyway;
of a bucket, or of a handle, few are left. Here most are of what is gripped or pushed, and none of the robot.
"""

from collections.abc import Mapping, Sequence

from artiskill.assets.articulated_object import Category
from artiskill.config import check
from artiskill.geometry.arrays import total

# of each mask, and of the points in none; by task, else by category
_SHARES: Mapping[str, tuple[int, ...]] = {
    "OpenCabinetDoor": (2, 5, 0, 1),
    "cabinet": (4, 3, 0, 1),
    "chair": (0, 1),
    "bucket": (0, 1),
}


def point_shares(task: str, category: Category) -> tuple[int, ...]:
    """Return the share of each mask of a task, then of the points in none; what they sum to does not matter."""
    return _SHARES.get(task, _SHARES[category])


def check_shares(shares: Sequence[int], mask_names: Sequence[str], task: str) -> None:
    """Raise `ConfigError` unless there is a share for each mask of a task, and one more."""
    wanted = len(mask_names) + 1
    names = ", ".join(mask_names)
    check(
        len(shares) == wanted,
        f"shares of points need {wanted} numbers for {task}, one for each of the masks {names}, and one for the "
        f"others, not {list(shares)}",
    )


def shared_out(points: int, shares: Sequence[int]) -> list[int]:
    """Return how many of the points each share is; what is left over goes to the largest."""
    found = [points * share // int(total(shares)) for share in shares]
    found[shares.index(max(shares))] += points - int(total(found))
    return found
