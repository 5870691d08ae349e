"""Which checks there are, and which of them an object of each category has to pass."""

from collections.abc import Callable
from dataclasses import dataclass

from artiskill.checks import ball, budget, drive, handles, hollow, mass, penetration, push, settle, surfaces, sweep
from artiskill.checks.config import ChecksConfig
from artiskill.checks.result import CheckResult
from artiskill.checks.specimen import Specimen

CheckFunction = Callable[[Specimen, ChecksConfig], list[CheckResult]]


@dataclass(frozen=True)
class Check:
    """A question to an object.

    Attributes:
        ask: the function that answers it; it names its results itself.
        needs_engine: whether it makes sense only if the engine compiles the object.
    """

    ask: CheckFunction
    needs_engine: bool = True


_ALL = (
    Check(budget.check_compiles, needs_engine=False),
    Check(budget.check_budget, needs_engine=False),
    Check(mass.check_mass),
    Check(penetration.check_penetration),
    Check(sweep.check_sweep),
    Check(drive.check_drive),
    Check(surfaces.check_surfaces, needs_engine=False),
    Check(handles.check_handles),
    Check(handles.check_reach, needs_engine=False),
)
_SETTLE = Check(settle.check_settle)

CHECKS: dict[str, tuple[Check, ...]] = {
    "cabinet": (*_ALL, Check(hollow.check_hollow, needs_engine=False)),
    "chair": (*_ALL, _SETTLE, Check(push.check_roll), Check(push.check_swivel)),
    "bucket": (*_ALL, _SETTLE, Check(ball.check_ball)),
}
