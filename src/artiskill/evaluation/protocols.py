"""Protocols: everything that makes numbers comparable, under one name.

Reports compare if their protocols have the same digest: of task, configuration, robot, objects with their content,
targets, levels, observation mode and control mode. The standard ones have names, such as
`artiskill-1/PushChair/test/joint/pointcloud`; any other evaluation is `custom/PushChair/<digest>`. Which points of
a cloud a policy keeps is its own business: it could as well choose from the full cloud that the protocol offers.
"""

import hashlib
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from artiskill.assets.catalog import list_objects, read_catalog
from artiskill.demos.settings import mapping_hash, task_hash
from artiskill.envs.control import CONTROL_MODES
from artiskill.envs.options import OBSERVATION_MODES
from artiskill.errors import ConfigError, PolicyError, check_name, shown
from artiskill.tasks.levels import MAX_LEVEL
from artiskill.tasks.registry import make_task
from artiskill.tasks.task import Task

ANY_TARGET = "any"
VERSION = "artiskill-1"  # another one as soon as the same name would mean other numbers
EPISODES = 50  # per object: as the benchmark of 2021
_TASKS = ("OpenCabinetDoor", "OpenCabinetDrawer", "PushChair", "MoveBucket")
_SPLITS = ("test", "ood")
_MOST_SALT = 200  # characters
# What a policy was made from, as the benchmark of 2021 has it; its author says which.
TRACKS = ("no-interactions", "no-external-annotations", "interactive-expert", "no-restrictions")
PRIVILEGED = "privileged"  # not a track to choose: policies of this package that read the simulation's state


@dataclass(frozen=True)
class Protocol:
    """What a report's numbers compare with.

    Attributes:
        id: its name.
        digest: of everything that it fixes, 16 hexadecimal digits.
    """

    id: str
    digest: str


@dataclass(frozen=True)
class StandardProtocol:
    """A protocol with a name.

    Attributes:
        task: name of the task, with its usual configuration.
        split: of the objects, `test` or `ood`.
        control_mode: of the actions.
        obs_mode: of the observations.
    """

    task: str
    split: str
    control_mode: str
    obs_mode: str

    @property
    def id(self) -> str:
        """Its name."""
        return f"{VERSION}/{self.task}/{self.split}/{self.control_mode}/{self.obs_mode}"

    @property
    def arguments(self) -> dict[str, Any]:
        """What `evaluate` is given, besides the policy."""
        return {
            "task": self.task,
            "objects": self.split,
            "episodes": EPISODES,
            "obs_mode": self.obs_mode,
            "control_mode": self.control_mode,
        }

    @property
    def rows(self) -> list[tuple[str, str, str]]:
        """Object, target and content hash of each row of a report."""
        names = list_objects(split=self.split, task=self.task)
        return [(name, ANY_TARGET, read_catalog()[name][1].content_hash) for name in names]

    @property
    def digest(self) -> str:
        """See `protocol_digest`."""
        task = make_task(self.task)
        return protocol_digest(task, self.rows, range(EPISODES), self.obs_mode, self.control_mode)


@cache
def standard_protocols() -> dict[str, StandardProtocol]:
    """Return all protocols with a name, by name."""
    every = itertools.product(_TASKS, _SPLITS, CONTROL_MODES, OBSERVATION_MODES)
    return {protocol.id: protocol for protocol in (StandardProtocol(*parts) for parts in every)}


def standard_protocol(name: str) -> StandardProtocol:
    """Return the protocol of a name.

    Raises:
        UnknownNameError: there is none.
    """
    check_name("protocol", name, standard_protocols(), "(`artiskill protocols` lists them)")
    return standard_protocols()[name]


def protocol_digest(
    task: Task, rows: Sequence[tuple[str, str, str]], levels: Sequence[int], obs_mode: str, control_mode: str
) -> str:
    """Return the digest of all that makes numbers comparable.

    Args:
        task: its resolved configuration, episodes' length and physics among it, and its robot.
        rows: object, target and content hash of each row of the report.
        levels: of each row's episodes.
        obs_mode: what policies may see.
        control_mode: what actions mean.
    """
    return mapping_hash(
        {
            "version": VERSION,
            "task": task.name,
            "configuration": task_hash(task),
            "rows": [list(row) for row in rows],
            "levels": list(levels),
            "obs_mode": obs_mode,
            "control_mode": control_mode,
        }
    )


def name_protocol(
    task: Task, rows: Sequence[tuple[str, str, str]], levels: Sequence[int], obs_mode: str, control_mode: str
) -> Protocol:
    """Return the protocol of an evaluation: a standard one, if it does just that; see `protocol_digest`."""
    digest = protocol_digest(task, rows, levels, obs_mode, control_mode)
    for one in standard_protocols().values():
        is_like = (one.task, one.control_mode, one.obs_mode) == (task.name, control_mode, obs_mode)
        if is_like and len(levels) == EPISODES and one.digest == digest:
            return Protocol(one.id, digest)
    return Protocol(f"custom/{task.name}/{digest}", digest)


def fresh_levels(salt: str, protocol_id: str, count: int) -> tuple[int, ...]:
    """Return levels that nobody could know who did not know the salt: hashes of salt, protocol and index.

    Args:
        salt: any text, chosen after the policy was handed in.
        protocol_id: of the same evaluation without fresh levels.
        count: how many, all different.

    Raises:
        ConfigError: an empty salt, a very long one, or one that does not print on one line.
    """
    if not isinstance(salt, str) or not 0 < len(salt) <= _MOST_SALT or not salt.isprintable():
        raise ConfigError(
            f"the salt of fresh levels is one line of 1 to {_MOST_SALT} characters, not {shown(salt)}"
        )
    found: dict[int, None] = {}
    for index in itertools.count():
        if len(found) == count:
            return tuple(found)
        text = f"{salt}\n{protocol_id}\n{index}"
        found[int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "big") % (MAX_LEVEL + 1)] = None
    raise AssertionError


def checked_track(track: str | None, is_privileged: bool, obs_mode: str) -> str | None:
    """Return the track that a report names.

    Args:
        track: as the policy's author says; None if nothing is said.
        is_privileged: whether the policy reads the simulation's state.
        obs_mode: what it sees.

    Raises:
        UnknownNameError: no such track.
        PolicyError: a policy that no track admits: tracks are of policies that see clouds or images.
    """
    if track is None:
        return PRIVILEGED if is_privileged else None
    check_name("track", track, TRACKS)
    if is_privileged or obs_mode == "state":
        what = "reads the simulation's state" if is_privileged else "sees obs_mode 'state'"
        raise PolicyError(f"tracks are of policies that see 'pointcloud' or 'rgbd'; this one {what}")
    return track
