"""Behaviour cloning of commands: what the hands of the demonstrations do, rather than their joints.

The demonstrations' actions become the commands that amount to them (`ActionReader`), so nothing but demonstrations
is needed; the robot's kinematics is known. The kinds of a command are what the fingers of the first hand do.
"""

from artiskill.learning.command_learner import CommandLearner


class CommandBC(CommandLearner):
    """A policy that commands what the demonstrations do."""
