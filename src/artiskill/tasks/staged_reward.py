"""Dense rewards in stages: a table of named terms that keeps three promises, whatever is measured.

Any state of a later stage earns more than any state of an earlier one; the reward is continuous where one stage
turns into the next; and no state earns more than 0. In stage k the reward is

    bonus[k] + blend * (bonus[k + 1] - bonus[k])  +  (1 - blend) * entered * (weighted sum of the terms asked)
    blend = leaving * entered / (leaving * entered + 1 - leaving)

`leaving` rises from 0 to 1 on the last stretch before stage k + 1, `entered` from 0 to 1 on the first stretch
after stage k - 1; well inside a stage `blend` is `leaving`. Terms lie in [0, 1] and their weights in a stage sum
to less than the step to the next bonus, so the second summand never reaches it. Where a stage is skipped the
reward jumps: what stages 0 and 2 earn cannot meet while all that stage 1 earns lies between.

No reward above 0 means that time is never paid for. Only success ends an episode early, so whoever can put it off
must not gain by that. Say a policy dawdles in and out of the last stage, and v <= 0 is the best that it earns
there. Had it kept still where it earned v, it would have been done after n more steps, for so long success must
hold, at a cost of at most n * -v. Any n steps of dawdling cost as much, and one of them costs more: to put the end
off it must break a condition of success, for which it leaves the last stage. If rewards were above 0, the best
policy would never finish.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from artiskill.config import check
from artiskill.geometry.arrays import Array, amin, clip, columns, namespace, total
from artiskill.geometry.kernel import inlined_kernel, kernel

# A stage's best state comes this near to the next stage's worst, relative to the step: never equal, never a jump.
_NEAREST = 1.0 - 1e-9
_LEAST_KEPT = 1e-12  # no division of 0 by 0 in single precision, for which 1 - _NEAREST is nothing
_ROUNDING = 1e-9  # of sums of decimal fractions
STAGE_TERM = "stage"
# A table's ramps: of the terms, then what stages are entered by, then what they are left by. One array of records,
# because a kernel takes a microsecond to unpack a tuple of as many arrays.
_RAMPS = np.dtype(
    [
        ("column", np.int64),  # of the measure
        ("zero", np.float64),  # where it begins
        ("scale", np.float64),  # one over its length
        ("stage", np.int64),  # that is entered or left by it; -1 for terms
        ("leaves", np.bool_),
    ],
    align=True,
)


class Ramp(NamedTuple):
    """A number in [0, 1]: 0 where the measure is `zero` or beyond, 1 where it is `one` or beyond, else linear."""

    measure: str
    zero: float
    one: float


class Stage(NamedTuple):
    """One stage of a task.

    Attributes:
        name: for people.
        asks: terms that count in it.
        enters: how far inside it is; the least of these counts. None means right away.
        leaves: how near the next one is; the least of these counts. The last stage has none. It is of each measure
            that the next stage is entered by, and ends where that one's begins.
    """

    name: str
    asks: tuple[str, ...]
    enters: tuple[Ramp, ...] = ()
    leaves: tuple[Ramp, ...] = ()


class StageTable:
    """Terms and stages of a task, as arrays.

    Args:
        terms: name -> ramp of a measure.
        stages: in their order; all but the last have something to leave by.

    Attributes:
        measures: names of all measures that the ramps are of.
    """

    def __init__(self, terms: Mapping[str, Ramp], stages: Sequence[Stage]) -> None:
        self.terms, self.stages = dict(terms), tuple(stages)
        enters = [(k, ramp) for k, stage in enumerate(stages) for ramp in stage.enters]
        leaves = [(k, ramp) for k, stage in enumerate(stages) for ramp in stage.leaves]
        ramps = [*self.terms.values(), *(ramp for _, ramp in (*enters, *leaves))]
        self.measures = tuple(dict.fromkeys(ramp.measure for ramp in ramps))
        self._leave_start = len(self.terms) + len(enters)
        self._ramps = np.zeros(len(ramps), dtype=_RAMPS)
        self._ramps["column"] = [self.measures.index(ramp.measure) for ramp in ramps]
        self._ramps["zero"] = [ramp.zero for ramp in ramps]
        self._ramps["scale"] = 1.0 / (np.array([ramp.one for ramp in ramps]) - self._ramps["zero"])
        self._ramps["stage"] = [-1] * len(self.terms) + [k for k, _ in (*enters, *leaves)]
        self._ramps["leaves"][self._leave_start :] = True
        # (K, T) whether a stage asks for a term, and (K,) what `leaving` is multiplied by: 0 in the last stage
        asked = [[name in stage.asks for name in self.terms] for stage in self.stages]
        self._asked = np.array(asked, dtype=float)
        self._leavable = np.array([_NEAREST if stage.leaves else 0.0 for stage in self.stages])

    def evaluate(
        self, measures: Mapping[str, Array] | Array, stage: Array, bonus: Sequence[float]
    ) -> dict[str, Array]:
        """Return the unweighted terms.

        Args:
            measures: name -> (B,), at least those of `measures`; or (B, M), these in their order.
            stage: (B,) number of the stage.
            bonus: of each stage.

        Returns:
            Name -> (B,): the table's terms in [0, 1], and `stage` between the bonus of this stage and the next.
        """
        is_named = isinstance(measures, Mapping)
        measured = columns([measures[name] for name in self.measures]) if is_named else measures
        if isinstance(measured, np.ndarray):
            table = np.empty((len(measured), len(self.terms) + 1))
            measured = np.ascontiguousarray(measured, dtype=np.float64)
            stage, bonus_array = np.asarray(stage, dtype=np.int64), np.array(bonus, dtype=np.float64)
            _terms_kernel(measured, stage, self._ramps, self._asked, self._leavable, bonus_array, table)
        else:
            table = self.terms_reference(measured, stage, bonus)
        return {name: table[:, i] for i, name in enumerate((*self.terms, STAGE_TERM))}

    def terms_reference(self, measured: Array, stage: Array, bonus: Sequence[float]) -> Array:
        """Return what `evaluate` does, for any array library and as (B, terms + 1): the kernel's definition.

        Args:
            measured: (B, M), one column per name in `measures`.
            stage: (B,) number of the stage.
            bonus: of each stage.
        """
        xp, dtype = namespace(measured), measured.dtype
        column, zero, scale, stages = (self._ramps[name].copy() for name in ("column", "zero", "scale", "stage"))
        zero, scale = xp.asarray(zero, dtype=dtype), xp.asarray(scale, dtype=dtype)
        ramps = clip((xp.take(measured, xp.asarray(column), axis=1) - zero) * scale, 0.0, 1.0)
        # 0 where a ramp counts in a stage, 1 where it does not: the greater of the two is what matters
        others = (stages != np.arange(len(self.stages))[:, None]).astype(float)
        floored = xp.maximum(ramps, xp.asarray(others, dtype=dtype)[stage])
        entered = amin(floored[:, len(self.terms) : self._leave_start])
        leaving = amin(floored[:, self._leave_start :]) * xp.asarray(self._leavable, dtype=dtype)[stage]
        kept = xp.maximum(1.0 - leaving, xp.asarray(_LEAST_KEPT, dtype=dtype))
        blend = leaving * entered / (leaving * entered + kept)
        gate = (1.0 - blend) * entered
        terms = ramps[:, : len(self.terms)] * xp.asarray(self._asked, dtype=dtype)[stage] * gate[:, None]
        least_reward = xp.asarray(np.array(bonus), dtype=dtype)[stage]
        steps = xp.asarray(np.append(np.diff(bonus), 0.0), dtype=dtype)
        return xp.concat((terms, (least_reward + blend * steps[stage])[:, None]), axis=1)

    def check_weights(self, bonus: Sequence[float], weights: Mapping[str, float]) -> None:
        """Refuse numbers that would break the order of the stages.

        Args:
            bonus: of each stage.
            weights: of the terms and of `stage`; a missing one is 0.

        Raises:
            ConfigError: another number of stages, an unknown term, a weight that is negative or not finite, a
                step between two bonuses that the terms of the lower stage can outweigh, or a last stage that can
                earn more than 0.
        """
        names = (*self.terms, STAGE_TERM)
        unknown = sorted(set(weights) - set(names))
        check(
            not unknown,
            f"reward.weights: unknown terms {unknown}; legal are those of the task's stages: {', '.join(names)}",
        )
        legal = all(math.isfinite(w) and w >= 0 for w in weights.values())
        check(legal, f"reward.weights must be finite numbers of at least 0, not {dict(weights)}")
        count = len(self.stages)
        finite = len(bonus) == count and all(map(math.isfinite, bonus))
        check(finite, f"reward.stage_bonus needs {count} finite numbers, not {list(bonus)}")
        for k, stage in enumerate(self.stages[:-1]):
            most = total(weights.get(name, 0.0) for name in stage.asks)
            step = (bonus[k + 1] - bonus[k]) * weights.get(STAGE_TERM, 0.0)
            check(
                step > most,
                f"reward.stage_bonus must rise by more than {most:g} from stage {k} ({stage.name}) to {k + 1}, "
                f"which the terms of that stage add up to; it rises by {step:g}: {list(bonus)}",
            )
        best = self.greatest(bonus, weights)
        check(
            best <= _ROUNDING,
            f"reward.stage_bonus: no state may earn more than 0, or putting off success pays; the last stage "
            f"({self.stages[-1].name}) can earn {best:g}: lower every bonus by at least as much: {list(bonus)}",
        )

    def greatest(self, bonus: Sequence[float], weights: Mapping[str, float]) -> float:
        """Return the best that any state can earn: the last stage's bonus and all terms that count in it."""
        terms = math.fsum(weights.get(name, 0.0) for name in self.stages[-1].asks)
        return bonus[-1] * weights.get(STAGE_TERM, 0.0) + terms


@kernel
def _terms_kernel(measured: Any, stage: Any, ramps: Any, asked: Any, leavable: Any, bonus: Any, out: Any) -> None:
    """Fill `out` (B, T + 1) as `StageTable.terms_reference` defines it, which takes 45 microseconds more."""
    terms = asked.shape[1]
    for b in range(measured.shape[0]):
        k = stage[b]
        entered, leaving = 1.0, 1.0
        for r in range(terms, ramps.shape[0]):
            ramp = ramps[r]
            if ramp.stage == k:
                value = _ramp(measured[b, ramp.column], ramp.zero, ramp.scale)
                if ramp.leaves:
                    leaving = min(leaving, value)
                else:
                    entered = min(entered, value)
        leaving *= leavable[k]
        blend = leaving * entered / (leaving * entered + 1.0 - leaving)
        gate = (1.0 - blend) * entered
        for r in range(terms):
            ramp = ramps[r]
            value = _ramp(measured[b, ramp.column], ramp.zero, ramp.scale)
            out[b, r] = value * asked[k, r] * gate
        step = bonus[k + 1] - bonus[k] if k + 1 < bonus.shape[0] else 0.0
        out[b, terms] = bonus[k] + blend * step


@inlined_kernel
def _ramp(measure: Any, zero: Any, scale: Any) -> Any:
    return min(max((measure - zero) * scale, 0.0), 1.0)


def load_kernel() -> None:
    """Compile the kernel, or read it from the disk's cache, now: no reset or step has to wait for it later."""
    ramp = Ramp("a", 0.0, 1.0)
    table = StageTable({"a": ramp}, (Stage("first", asks=("a",), leaves=(ramp,)), Stage("last", asks=("a",))))
    table.evaluate({"a": np.zeros(1)}, np.zeros(1, dtype=np.int64), (0.0, 1.0))
