"""What a snapshot says of itself."""

import inspect
import re
from dataclasses import fields
from functools import cached_property

from artiskill.sim.snapshot import Snapshot


def test_everything_that_can_be_read_is_described() -> None:
    described = re.findall(r"^ {4}(\w+): \S", inspect.getdoc(Snapshot) or "", re.MULTILINE)
    computed = {name for name, value in vars(Snapshot).items() if isinstance(value, property | cached_property)}
    assert {"link_speed_m_s", "link_angular_speed_rad_s", "fingertip_position_w"} <= computed
    assert sorted(described) == sorted(computed | {f.name for f in fields(Snapshot)})
