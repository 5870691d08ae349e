"""DAgger (Ross et al., 2011): the policy acts, the expert says what it would have done, the policy learns that.

A round adds what policy and expert have met (`learning/rollouts.py`); training goes on with all rounds so far.
What is learned are the expert's commands (`learning/command_learner.py`).
"""

from dataclasses import dataclass, field
from typing import Any

from artiskill.config import check, check_inside, check_positive, check_value
from artiskill.learning.command_learner import CommandLearner, CommandLearnerConfig


@dataclass(frozen=True)
class DAggerConfig(CommandLearnerConfig):
    """Values of DAgger: of learning commands, and here of the rollouts."""

    objects: tuple[str, ...]  # as `resolve_objects` takes them, never of a split that is measured
    generated_share: float | None  # of the episodes, on the generated ones; None: all objects are equally likely
    expert: dict[str, Any]  # values of the expert that differ from its own
    points: int  # of a cloud
    shares: tuple[int, ...]  # how these are shared out among the masks, and the points in none
    rounds: int
    collectors: int  # vectors of environments in each round; as many processes may share them
    envs: int  # in each vector
    rollout_steps: int  # of each environment
    expert_rounds: int  # the first ones, in which the expert alone acts
    whole_share: float  # of the later episodes, those in which the policy acts to the end
    takeover_steps: tuple[int, int]  # fewest and most steps of the others after which the expert takes over
    # the network gives one command, not one for each kind; see `CommandSpace`
    one_kind: bool = field(default=False, kw_only=True)

    def __post_init__(self) -> None:
        check_positive(self, "points", "rounds", "expert_rounds")
        check_positive(self, "collectors", "envs", "rollout_steps")
        check_inside("whole_share", self.whole_share, (0, 1))
        if self.generated_share is not None:
            check_inside("generated_share", self.generated_share, (0, 1))
        check_value(self, "objects", len(self.objects) > 0, "needs objects")
        are_shares = len(self.shares) > 0 and min(self.shares) >= 0 and sum(self.shares) > 0
        check_value(self, "shares", are_shares, "needs numbers of at least 0, and one above")
        low, high = self.takeover_steps
        check_value(self, "takeover_steps", 0 <= low <= high, "must be two rising whole numbers from 0 on")

    @property
    def round_samples(self) -> int:
        """Steps that a round adds at most."""
        return self.collectors * self.envs * self.rollout_steps

    def round_steps(self, steps: int) -> int:
        """Return how many of so many steps of training lie between two rounds; the last may have fewer.

        Raises:
            ConfigError: not all rounds would begin.
        """
        found, fitting = -(-steps // self.rounds), fitting_steps(steps, self.rounds)
        text = f"{steps} steps have room for {-(-steps // found)} rounds of {found}, not for algorithm.rounds"
        check(fitting == steps, f"{text}={self.rounds}; {fitting} have")
        return found


def fitting_steps(steps: int, rounds: int) -> int:
    """Return so many steps of training, or as many as whole rounds take if not all would begin in them."""
    of_round = -(-steps // rounds)
    last_begins = (rounds - 1) * of_round
    return steps if steps > last_begins else rounds * of_round


class DAgger(CommandLearner):
    """A policy that commands as the expert would."""

    Config = DAggerConfig
