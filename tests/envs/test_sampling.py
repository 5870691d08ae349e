"""Which object an episode has."""

from dataclasses import replace

import pytest

from artiskill.assets.catalog import load_object
from artiskill.envs.sampling import EpisodeSampler
from artiskill.errors import UnknownNameError
from artiskill.tasks.registry import make_task


def test_objects_that_a_name_leads_to_are_not_kept() -> None:
    sampler = EpisodeSampler(make_task("OpenCabinetDrawer"), "generated:cabinet:0..40")
    for level in range(12):
        sampler.draw(level)
    sampler.draw(0, "cabinet-0003")
    assert not sampler._known


def test_the_last_objects_that_were_handed_in_are_known_by_id() -> None:
    sampler = EpisodeSampler(make_task("OpenCabinetDrawer"), "cabinet-0002")
    own = [replace(load_object("cabinet-0003"), id=f"own-{k}") for k in range(70)]
    for obj in own:
        sampler.draw(0, obj)
    assert sampler.find("own-69") is own[69]
    assert sampler.find("own-6") is own[6]
    with pytest.raises(UnknownNameError, match="own-5"):
        sampler.find("own-5")
