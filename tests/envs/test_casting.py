"""Which object an episode has."""

from dataclasses import replace

import pytest

from artiskill.assets.catalog import load_object
from artiskill.envs.casting import Casting
from artiskill.errors import UnknownNameError
from artiskill.tasks.registry import make_task


def test_objects_that_a_name_leads_to_are_not_kept() -> None:
    casting = Casting(make_task("OpenCabinetDrawer"), "generated:cabinet:0..40")
    for level in range(12):
        casting.draw(level)
    casting.draw(0, "cabinet-0003")
    assert not casting._known


def test_the_last_objects_that_were_handed_in_are_known_by_id() -> None:
    casting = Casting(make_task("OpenCabinetDrawer"), "cabinet-0002")
    own = [replace(load_object("cabinet-0003"), id=f"own-{k}") for k in range(70)]
    for obj in own:
        casting.draw(0, obj)
    assert casting.find("own-69") is own[69]
    assert casting.find("own-6") is own[6]
    with pytest.raises(UnknownNameError, match="own-5"):
        casting.find("own-5")
