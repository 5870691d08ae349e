"""How the points of small clouds are shared out among a task's masks, where sampling is by `shares`.

By the paper's method two of three points lie in a mask, most of them on the robot, whose joints are known anyway;
of a bucket, or of a handle, few are left. Here most are of what is gripped or pushed, and none of the robot.
"""

from collections.abc import Mapping, Sequence

from artiskill.geometry.arrays import total

_OTHERS = ""  # the points in no mask
# by task, else for all: the share of each mask, by its name
_SHARES: Mapping[str, Mapping[str, int]] = {
    "OpenCabinetDoor": {"handle": 2, "link": 5, "robot": 0, _OTHERS: 1},
    "": {"handle": 4, "link": 3, "robot": 0, _OTHERS: 1},
}
_UNKNOWN = 3  # of a mask that is not among these


def point_shares(task: str, mask_names: Sequence[str]) -> tuple[int, ...]:
    """Return the share of each mask of a task, then of the points in none; what they sum to does not matter."""
    found = _SHARES.get(task, _SHARES[""])
    return tuple(found.get(name, _UNKNOWN) for name in (*mask_names, _OTHERS))


def shared_out(points: int, shares: Sequence[int]) -> list[int]:
    """Return how many of the points each share is: none more than one away from its exact part."""
    whole = int(total(shares))
    found = [points * share // whole for share in shares]
    most = sorted(range(len(shares)), key=lambda k: (-(points * shares[k] % whole), k))
    for k in most[: points - int(total(found))]:
        found[k] += 1
    return found
