import hashlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from artiskill.assets.catalog import list_objects
from artiskill.errors import ConfigError, PolicyError, UnknownNameError
from artiskill.evaluation.evaluate import evaluate
from artiskill.evaluation.plan import plan_evaluation
from artiskill.evaluation.protocols import (
    EPISODES,
    TRACKS,
    fresh_levels,
    standard_protocol,
    standard_protocols,
)

TASK, OBJECT = "OpenCabinetDrawer", "cabinet-0005"
DRAWERS = "artiskill-1/OpenCabinetDrawer/test/joint/state"
# What the names stand for. If one of them changes, so do the numbers: choose another `protocols.VERSION`. (Before
# the first release, all changed with the key `state` and with rewards; success is as before.)
DIGESTS = {
    "artiskill-1/OpenCabinetDoor/test/joint/pointcloud": "87a0932dbaed2d0f",
    "artiskill-1/OpenCabinetDoor/ood/joint/pointcloud": "4fdf75930d7bc3a7",
    "artiskill-1/OpenCabinetDrawer/test/joint/pointcloud": "cbb0a86d01927a5f",
    "artiskill-1/OpenCabinetDrawer/ood/joint/pointcloud": "b24502b0443e7016",
    "artiskill-1/PushChair/test/joint/pointcloud": "4396091743bc4617",
    "artiskill-1/PushChair/ood/joint/pointcloud": "d1122517d79ecb36",
    "artiskill-1/MoveBucket/test/joint/pointcloud": "3627e38f32a51fb9",
    "artiskill-1/MoveBucket/ood/joint/pointcloud": "6e7744ba402aa597",
}


def test_names_stand_for_the_same_numbers_as_ever() -> None:
    assert {name: standard_protocol(name).digest for name in DIGESTS} == DIGESTS


def test_each_task_has_each_split_and_mode() -> None:
    assert len(standard_protocols()) == 4 * 2 * 2 * 3
    assert all(name == protocol.id for name, protocol in standard_protocols().items())
    rows = standard_protocol(DRAWERS).rows
    assert [row[0] for row in rows] == list_objects(split="test", task=TASK)
    assert len(rows) == 10
    assert len({protocol.digest for protocol in standard_protocols().values()}) == 48


def test_an_unknown_name_gets_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match=f"unknown protocol .* did you mean '{DRAWERS}'"):
        standard_protocol(DRAWERS.replace("Drawer", "Drawr"))


def test_an_evaluation_is_named_by_what_it_does() -> None:
    arguments = standard_protocol(DRAWERS).arguments
    plan = plan_evaluation(policy="still", **arguments)
    assert (plan.protocol.id, plan.protocol.digest) == (DRAWERS, standard_protocol(DRAWERS).digest)
    assert plan.num_episodes == 10 * EPISODES
    assert plan_evaluation(policy="still", **arguments | {"episodes": 49}).protocol.id.startswith("custom/")


@pytest.mark.parametrize(
    "change",
    [
        {"objects": "cabinet-0010"},
        {"target": "link_0"},
        {"episodes": 3},
        {"first_level": 1},
        {"obs_mode": "rgbd"},
        {"control_mode": "operational_space"},
        {"config": {"episode_steps": 199}},
        {"config": {"physics.timestep_s": 0.0025}},
        {"salt": "a"},
    ],
)
def test_whatever_changes_numbers_changes_the_digest(change: dict[str, Any]) -> None:
    arguments: dict[str, Any] = {"task": TASK, "policy": "still", "objects": OBJECT, "episodes": 2}
    one, other = plan_evaluation(**arguments), plan_evaluation(**arguments | change)
    assert one.protocol.digest != other.protocol.digest
    assert one.protocol.id != other.protocol.id


def test_what_belongs_to_the_policy_does_not(solution: Callable[[str], Path]) -> None:
    """The full cloud is on offer; which of its points are used is up to who uses them."""
    text = (
        "class Policy:\n    obs_mode = 'pointcloud'{}\n    def reset(self, o, i): ...\n    def act(self, o): ...\n"
    )
    one, other = (
        plan_evaluation(TASK, solution(text.format(sampling)), OBJECT, 2)
        for sampling in ("", "\n    sampling = {'num_points': 64}")
    )
    assert one.protocol == other.protocol
    assert one.batches[0].sampling != other.batches[0].sampling


def test_fresh_levels_are_hashes() -> None:
    levels = fresh_levels("salt", "name", 3)
    expected = [
        int.from_bytes(hashlib.sha256(b"salt\nname\n%d" % index).digest()[:8], "big") % 2**31 for index in range(3)
    ]
    assert list(levels) == expected
    assert len(set(fresh_levels("salt", "name", 2000))) == 2000
    assert not set(levels) & set(fresh_levels("other", "name", 3))
    assert not set(levels) & set(fresh_levels("salt", "another", 3))


@pytest.mark.parametrize("salt", ["", "a\nb", "x" * 201, 5])
def test_salts_that_are_none(salt: Any) -> None:
    with pytest.raises(ConfigError, match="salt of fresh levels is one line of 1 to 200 characters"):
        evaluate(TASK, "still", OBJECT, 1, salt=salt)


def test_fresh_levels_have_no_first_one() -> None:
    with pytest.raises(ConfigError, match="fresh levels have no first one"):
        evaluate(TASK, "still", OBJECT, 1, 5, salt="a")


def test_a_report_names_its_track() -> None:
    def track(policy: Any, obs_mode: str | None = None, given: str | None = None) -> str | None:
        return plan_evaluation(TASK, policy, OBJECT, 1, obs_mode=obs_mode, track=given).track

    def blind(observation: Any) -> list[float]:
        return [0.0] * 13

    assert (track("expert"), track("demonstrator"), track("random"), track(blind)) == ("privileged",) * 2 + (
        None,
    ) * 2
    for name in TRACKS:
        assert track(blind, "rgbd", name) == name
    with pytest.raises(UnknownNameError, match="did you mean 'no-restrictions'"):
        track(blind, "rgbd", "no-restriction")
    with pytest.raises(PolicyError, match="tracks are of policies that see 'pointcloud' or 'rgbd'; this one sees"):
        track(blind, "state", TRACKS[0])
    with pytest.raises(PolicyError, match="this one reads the simulation's state"):
        track("expert", "rgbd", TRACKS[0])


def test_a_standard_protocol_is_a_value() -> None:
    one = standard_protocol(DRAWERS)
    assert replace(one, split="ood").id == DRAWERS.replace("test", "ood")
