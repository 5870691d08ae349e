"""PushChair: push a swivel chair to a target on the ground and leave it standing there."""

from artiskill.tasks.push_chair.task import PushChairConfig, make_push_chair

__all__ = ["PushChairConfig", "make_push_chair"]
