"""Driving by hand: how a person's wishes become actions, and the gizmos, buttons and keys that they come from."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from artiskill.demos.recording import rounded
from artiskill.demos.settings import load_demos_config
from artiskill.envs.control import OPERATIONAL, Control
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.evaluation.policies import Actor
from artiskill.geometry.arrays import rotate
from artiskill.geometry.rotations import (
    quat_conjugate,
    quat_from_axis_angle,
    quat_from_matrix,
    quat_multiply,
    quat_to_matrix,
    quat_to_rotation_vector,
)
from artiskill.robots.operational_space import TRUNK
from artiskill.sim.snapshot import Snapshot

Do = Callable[[Callable[[], None]], None]  # has something done by the thread of the page
# share of a hand's way that it is asked to go per second, and of its greatest velocity that it is asked for
_HAND_GAIN_S, _HAND_SHARE = 4.0, 0.5
_PUSH_STEPS, _BRAKE_STEPS = 3, 2  # for which a push drives the trunk, and in which it then comes to rest
# button and key that drive the trunk: shares of the greatest velocity forward, to the left, of yaw and of the lift
_WAYS = {
    ("forward", "I"): (0.6, 0.0, 0.0, 0.0),
    ("back", "K"): (-0.6, 0.0, 0.0, 0.0),
    ("left", "J"): (0.0, 0.6, 0.0, 0.0),
    ("right", "L"): (0.0, -0.6, 0.0, 0.0),
    ("turn left", "U"): (0.0, 0.0, 0.2, 0.0),
    ("turn right", "O"): (0.0, 0.0, -0.2, 0.0),
    ("up", "Y"): (0.0, 0.0, 0.0, 0.4),
    ("down", "H"): (0.0, 0.0, 0.0, -0.4),
}
_FINGERS_KEY = "N"
_OPEN_MM, _GIZMO_M = 40, 0.25  # a finger from the middle; the size of a gizmo


def from_browser(event: Any, do: Do, command: Callable[[], None]) -> None:
    """Have a command done if a person caused the event, and not the program."""
    if event.client_id is not None:
        do(command)


class HandActor(Actor):
    """A person who drives the robot: hands go to poses, the trunk goes where it is pushed.

    Actions come about through the control mode `operational_space`, whichever the environment has, and are rounded
    as demonstrations store them: what is recorded is what was played.

    Args:
        env: whose robot is driven.

    Attributes:
        positions_w: (A, 3) where the hands shall be.
        quaternions_w: (A, 4) likewise.
        opening_m: of all fingers, each from the middle.
        has_moved_on: whether the wanted poses have gone with the trunk; who has seen it sets it back.
    """

    name = "by hand"

    def __init__(self, env: ManipulationEnv) -> None:
        self._control = Control(env.task.robot, OPERATIONAL)
        self._action_bits = load_demos_config().store.action_bits
        self._trunk_share, self._steps = np.zeros(TRUNK), 0
        self.opening_m = float(self._control.scale.center[-1])
        self._stay(env.snapshot)

    def reset(self, env: ManipulationEnv, observation: Any, info: dict[str, Any]) -> None:
        """Begin where the robot is, and stay there."""
        self._steps = 0
        self._stay(env.snapshot)

    def _stay(self, snapshot: Snapshot) -> None:
        self.has_moved_on, self._trunk = True, snapshot.robot_qpos[0, :TRUNK].copy()
        self.positions_w = snapshot.tool_position_w[0].copy()
        self.quaternions_w = np.stack([quat_from_matrix(turn) for turn in snapshot.tool_rotation_w[0]])

    def _go_along(self, snapshot: Snapshot) -> None:
        """Move the wanted poses as the trunk has moved since the last step: who presses goes on pressing."""
        trunk = snapshot.robot_qpos[0, :TRUNK].copy()
        if self._steps:
            turn = quat_from_axis_angle((0.0, 0.0, 1.0), trunk[2] - self._trunk[2])
            before, now = (np.array((pose[0], pose[1], pose[3])) for pose in (self._trunk, trunk))
            self.positions_w = rotate(quat_to_matrix(turn), self.positions_w - before) + now
            self.quaternions_w = quat_multiply(turn, self.quaternions_w)
            self.has_moved_on = True
        self._trunk = trunk

    def push(self, trunk_share: Sequence[float]) -> None:
        """Push the trunk for a moment; the hands go with it.

        Args:
            trunk_share: (4,) base forward, to its left, yaw to the left and lift, shares of the greatest velocity.
        """
        self._trunk_share, self._steps = np.asarray(trunk_share, dtype=float), _PUSH_STEPS + _BRAKE_STEPS

    def act(self, env: ManipulationEnv, observation: Any) -> np.ndarray:
        """Return the next action, (A,)."""
        snapshot, scale = env.snapshot, self._control.scale
        values = scale.center.copy()
        arms = values[TRUNK:].reshape(len(self.positions_w), -1)
        arms[:, -2:] = self.opening_m
        self._go_along(snapshot)
        if self._steps > _BRAKE_STEPS:
            values[:TRUNK] = self._trunk_share * scale.half_range[:TRUNK]
        self._steps = max(self._steps - 1, 0)
        arms[:, :6] = self._twists(snapshot)
        targets = self._control.to_targets(scale.to_actions(values)[None], snapshot)
        action = np.clip(env.control.to_actions(targets, snapshot)[0], -1.0, 1.0)
        return rounded(action, self._action_bits)

    def close(self) -> None:
        """Do nothing: a person has no process."""
        return

    def _twists(self, snapshot: Snapshot) -> np.ndarray:
        """Return (A, 6) velocities, in the hands' own axes, that lead towards the wanted poses."""
        turns = snapshot.tool_rotation_w[0]
        back = np.stack([quat_conjugate(quat_from_matrix(turn)) for turn in turns])
        linear = np.einsum("aji,aj->ai", turns, self.positions_w - snapshot.tool_position_w[0])
        angular = quat_to_rotation_vector(quat_multiply(back, self.quaternions_w))
        twists = _HAND_GAIN_S * np.concatenate((linear, angular), axis=1)
        half = self._control.scale.half_range[TRUNK:].reshape(len(turns), -1)[:, :6]
        excess = np.abs(twists / half).max(axis=1, keepdims=True)
        return twists / np.maximum(excess / _HAND_SHARE, 1.0)  # slower, but in the same direction


class HandPanel:
    """What a person drives with: a switch, a button and a key for each way, the fingers, a gizmo at each hand.

    Args:
        server: of viser; the widgets go into the folder that is open.
        do: of the page.
        switch: called when a person takes over (True), or hands back (False).
    """

    def __init__(self, server: Any, do: Do, switch: Callable[[bool], None]) -> None:
        self._server, self._do = server, do
        self._hand: HandActor | None = None
        self._gizmos: list[Any] = []
        gui = server.gui
        self._switch = gui.add_checkbox("drive", initial_value=False, hint="from the step that is shown")
        self._switch.on_update(lambda event: from_browser(event, do, lambda: switch(self._switch.value)))
        for (name, key), share in _WAYS.items():
            push = partial(do, partial(self._push, share))
            button = gui.add_button(f"{name} ({key})", hint="hold it")
            button.on_hold(lambda event, push=push: push(), callback_hz=10.0)
            gui.add_command(name, hotkey=key).on_trigger(lambda event, push=push: push())
        self._fingers = gui.add_slider(f"fingers (mm; {_FINGERS_KEY})", 0, _OPEN_MM, 1, _OPEN_MM)
        self._fingers.on_update(lambda event: from_browser(event, do, self._set_fingers))
        gui.add_command("fingers", hotkey=_FINGERS_KEY).on_trigger(lambda event: do(self._toggle_fingers))
        self.note = gui.add_markdown("")

    def attach(self, hand: HandActor) -> None:
        """Have a hand go where the gizmos, buttons and keys say."""
        self.detach()
        self._hand = hand
        self._switch.value = True
        self._set_fingers()
        self._gizmos = [self._add_gizmo(hand, arm) for arm in range(len(hand.positions_w))]

    def detach(self) -> None:
        """Let go, and take the gizmos away."""
        for gizmo in self._gizmos:
            gizmo.remove()
        self._gizmos, self._hand = [], None
        self._switch.value = False

    def follow(self) -> None:
        """Let the gizmos follow hands that have gone with the trunk."""
        hand = self._hand
        if hand is None or not hand.has_moved_on:  # else a person may be moving them
            return
        hand.has_moved_on = False
        for gizmo, position, quaternion in zip(self._gizmos, hand.positions_w, hand.quaternions_w, strict=True):
            gizmo.position, gizmo.wxyz = position, quaternion

    def _add_gizmo(self, hand: HandActor, arm: int) -> Any:
        """Return a gizmo at a hand; where it is moved to, the hand goes."""
        gizmo = self._server.scene.add_transform_controls(
            f"/hand-{arm}", scale=_GIZMO_M, depth_test=False, position=hand.positions_w[arm]
        )
        gizmo.wxyz = hand.quaternions_w[arm]

        def follow() -> None:
            hand.positions_w[arm], hand.quaternions_w[arm] = gizmo.position, gizmo.wxyz

        gizmo.on_update(lambda event: from_browser(event, self._do, follow))
        return gizmo

    def _push(self, share: Sequence[float]) -> None:
        if self._hand is not None:
            self._hand.push(share)

    def _set_fingers(self) -> None:
        if self._hand is not None:
            self._hand.opening_m = self._fingers.value / 1000.0

    def _toggle_fingers(self) -> None:
        if self._hand is not None:
            self._fingers.value = 0 if self._fingers.value > _OPEN_MM / 2 else _OPEN_MM
            self._set_fingers()
