"""What a check says: one value, what is legal, and whether it holds."""

import math
from dataclasses import dataclass

Limits = tuple[float | None, float | None]
_ROUNDING = 1 + 1e-9


@dataclass(frozen=True)
class CheckResult:
    """One finding.

    Attributes:
        check: name of the check, a key of `checks.table.CHECKS`.
        subject: what was looked at: a link, a pair of links, a joint, a handle, or `object`.
        value: what was measured; None where there is nothing to measure.
        limit: lowest and highest legal value, each None where there is none.
        unit: of value and limit.
        passed: whether the value is legal.
        note: what a person wants to know beside the numbers; where a check fails, what is wrong.
    """

    check: str
    subject: str
    value: float | None
    limit: Limits
    unit: str
    passed: bool
    note: str = ""

    @property
    def legal(self) -> str:
        """The limit as text, `<= 1 mm` say."""
        low, high = self.limit
        if low is None and high is None:
            return ""
        unit = f" {self.unit}" if self.unit else ""
        if low is None:
            return f"<= {high:g}{unit}"
        return f">= {low:g}{unit}" if high is None else f"{low:g} to {high:g}{unit}"

    @property
    def measured(self) -> str:
        """The value as text."""
        if self.value is None:
            return ""
        digits = ".0f" if self.unit == "" or abs(self.value) >= 99.95 else ".2f" if abs(self.value) < 10 else ".1f"
        return f"{self.value:{digits}}{' ' if self.unit else ''}{self.unit}"


def at_most(check: str, subject: str, value: float, limit: float, unit: str = "", note: str = "") -> CheckResult:
    """A value that must not exceed a limit; what is not a number does."""
    return CheckResult(check, subject, float(value), (None, limit), unit, bool(value <= limit * _ROUNDING), note)


def at_least(check: str, subject: str, value: float, limit: float, unit: str = "", note: str = "") -> CheckResult:
    """A value that must not fall short of a limit; what is not a number does."""
    return CheckResult(check, subject, float(value), (limit, None), unit, bool(value * _ROUNDING >= limit), note)


def within(
    check: str, subject: str, value: float, limits: tuple[float, ...], unit: str = "", note: str = ""
) -> CheckResult:
    """A value that must lie between two limits."""
    low, high = limits
    legal = math.isfinite(value) and low <= value <= high
    return CheckResult(check, subject, float(value), (low, high), unit, legal, note)


def failed(check: str, subject: str, note: str) -> CheckResult:
    """Something is wrong that has no number."""
    return CheckResult(check, subject, None, (None, None), "", False, note)


def fine(check: str, subject: str, note: str) -> CheckResult:
    """Something is right that has no number, or there is nothing to look at."""
    return CheckResult(check, subject, None, (None, None), "", True, note)
