"""Driving by hand: how a person's wishes become actions, and the gizmos, buttons and keys that they come from."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from artiskill.demos.recording import rounded
from artiskill.demos.settings import load_demos_config
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.evaluation.policies import Actor
from artiskill.experts.whole_body import TRUNK, WholeBodyConfig, WholeBodyController
from artiskill.geometry.arrays import rotate
from artiskill.geometry.rotations import (
    quat_conjugate,
    quat_from_axis_angle,
    quat_from_matrix,
    quat_multiply,
    quat_to_matrix,
    quat_to_rotation_vector,
)
from artiskill.sim.snapshot import Snapshot

Do = Callable[[Callable[[], None]], None]  # has something done by the thread of the page
# share of a hand's way, and of its turn, that it is asked to go per second, and of its greatest velocity that it
# is asked for. Who presses turns the hand, too: turned too gently, one finger of each lets go of a bucket.
_HAND_GAIN_S, _TURN_GAIN_S, _HAND_SHARE = 4.0, 12.0, 0.5
# the trunk goes as it is pushed, and nowhere for the hands' sake; arms strive a little for their first posture:
# who has dragged one until it is straight can drag it back
_WEIGHTS = WholeBodyConfig(base_damping=30.0, yaw_damping=30.0, lift_damping=30.0, arm_damping=0.04)
_POSTURE_GAIN_S = 0.5
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
_DRIVE, _HAND_BACK = "drive", "hand back"
_FINGERS_KEY, _PAIR_KEY, _NEARER_KEY, _FARTHER_KEY = "N", "B", "G", "T"
_OPEN_MM, _GIZMO_M = 40, 0.25  # a finger from the middle; the size of a gizmo
_PAIR_M = (0.65, 0.15, 0.7)  # a new pair: ahead of the base, above the lift, apart
_APART_CM = (5, 90)
_RIGHT_LEFT = np.array((-1.0, 1.0))  # where the arms are, along the y axis of a pair
_DOWN = np.array((0.0, 0.0, -1.0))
# of the hands in a pair's axes, columns: they point at each other, their fingers beside each other
_FACING = [
    quat_from_matrix(np.stack((_DOWN, (side, 0.0, 0.0), (0.0, -side, 0.0)), axis=-1)) for side in _RIGHT_LEFT
]


def from_browser(event: Any, do: Do, command: Callable[[], None]) -> None:
    """Have a command done if a person caused the event, and not the program."""
    if event.client_id is not None:
        do(command)


@dataclass
class Pair:
    """Two hands that face each other and move as one.

    Attributes:
        position_w: (3,) of the point between them.
        quaternion_w: (4,) the y axis points from the right hand to the left one, the z axis up.
        apart_m: from one hand to the other.
    """

    position_w: np.ndarray
    quaternion_w: np.ndarray
    apart_m: float

    def hands(self) -> tuple[np.ndarray, np.ndarray]:
        """Return where the hands are, positions (2, 3) and quaternions (2, 4)."""
        across = quat_to_matrix(self.quaternion_w)[:, 1]
        positions = self.position_w + 0.5 * self.apart_m * _RIGHT_LEFT[:, None] * across
        return positions, np.stack([quat_multiply(self.quaternion_w, facing) for facing in _FACING])


class HandActor(Actor):
    """A person who drives the robot: hands go to poses, the trunk goes where it is pushed.

    Actions come about as twists of the hands, within the joints' limits, and are rounded as demonstrations store
    them: what is recorded is what was played.

    Args:
        env: whose robot is driven.

    Attributes:
        positions_w: (A, 3) where the hands shall be.
        quaternions_w: (A, 4) likewise.
        opening_m: of all fingers, each from the middle.
        pair: two hands that move as one; None while each moves for itself.
        has_moved_on: whether the wanted poses have gone with the trunk; who has seen it sets it back.
    """

    name = "by hand"

    def __init__(self, env: ManipulationEnv) -> None:
        robot, arms = env.task.robot, len(env.task.robot.mounts)
        self._body = WholeBodyController(robot, _WEIGHTS, arms)
        self._rest_rad = np.tile(robot.initial.arm_qpos_rad, arms)
        speeds = [robot.actions.hand_velocity_m_s] * 3, [robot.actions.hand_rate_rad_s] * 3
        self._most = _HAND_SHARE * np.concatenate(speeds)
        self._action_bits = load_demos_config().store.action_bits
        self._trunk_share, self._steps = np.zeros(TRUNK), np.zeros(TRUNK, dtype=int)
        self.pair: Pair | None = None
        self.opening_m = float(self._body.scale.center[-1])
        self._stay(env.snapshot)

    def reset(self, env: ManipulationEnv, observation: Any, info: dict[str, Any]) -> None:
        """Begin where the robot is, and stay there."""
        self._steps[:] = 0
        self._stay(env.snapshot)

    def _stay(self, snapshot: Snapshot) -> None:
        self.has_moved_on, self._trunk = True, snapshot.robot_qpos[0, :TRUNK].copy()
        self._held, self.pair = self._trunk, None
        self.positions_w = snapshot.tool_position_w[0].copy()
        self.quaternions_w = np.stack([quat_from_matrix(turn) for turn in snapshot.tool_rotation_w[0]])

    def _go_along(self, snapshot: Snapshot) -> None:
        """Move the wanted poses as the trunk has moved since the last step: who presses goes on pressing."""
        trunk = snapshot.robot_qpos[0, :TRUNK].copy()
        if self._steps.any():
            turn = quat_from_axis_angle((0.0, 0.0, 1.0), trunk[2] - self._trunk[2])
            before, now = (np.array((pose[0], pose[1], pose[3])) for pose in (self._trunk, trunk))

            def moved(position_w: np.ndarray) -> np.ndarray:
                return rotate(quat_to_matrix(turn), position_w - before) + now

            if self.pair is None:
                self.positions_w = moved(self.positions_w)
                self.quaternions_w = quat_multiply(turn, self.quaternions_w)
            else:
                pair = self.pair
                self.move_pair(moved(pair.position_w), quat_multiply(turn, pair.quaternion_w), pair.apart_m)
            self.has_moved_on = True
        self._trunk = trunk

    def join(self) -> None:
        """Have two hands come face to face before the robot, and move as one from now on."""
        x, y, yaw, lift = self._trunk
        ahead_m, up_m, apart_m = _PAIR_M
        position_w = np.array((x + ahead_m * np.cos(yaw), y + ahead_m * np.sin(yaw), lift + up_m))
        self.move_pair(position_w, quat_from_axis_angle((0.0, 0.0, 1.0), yaw), apart_m)

    def move_pair(self, position_w: np.ndarray, quaternion_w: np.ndarray, apart_m: float) -> None:
        """Move two hands as one; see `Pair`."""
        self.pair = Pair(np.asarray(position_w), np.asarray(quaternion_w), apart_m)
        self.positions_w, self.quaternions_w = self.pair.hands()

    def _trunk_velocity(self) -> np.ndarray:
        """Return (4,): base and lift go as they are pushed, else back to where they stopped: loads move them."""
        is_moving = self._steps > 0
        is_moving[:3] = is_moving[:3].any()
        pushed = self._trunk_share * self._body.max_speed[:TRUNK] * (self._steps > _BRAKE_STEPS)
        cosine, sine = np.cos(self._trunk[2]), np.sin(self._trunk[2])
        pushed[:2] = cosine * pushed[0] - sine * pushed[1], sine * pushed[0] + cosine * pushed[1]
        self._held = np.where(is_moving, self._trunk, self._held)
        return np.where(is_moving, pushed, _HAND_GAIN_S * (self._held - self._trunk))

    def push(self, trunk_share: Sequence[float]) -> None:
        """Push the trunk for a moment; the hands go with it.

        Args:
            trunk_share: (4,) base forward, to its left, yaw to the left and lift, shares of the greatest velocity.
        """
        share = np.asarray(trunk_share, dtype=float)
        is_meant = share != 0.0  # a push forward goes on during one to the left
        self._trunk_share[is_meant], self._steps[is_meant] = share[is_meant], _PUSH_STEPS + _BRAKE_STEPS

    def act(self, env: ManipulationEnv, observation: Any) -> np.ndarray:
        """Return the next action, (A,)."""
        snapshot, body = env.snapshot, self._body
        self._go_along(snapshot)
        trunk = self._trunk_velocity()
        self._steps = np.maximum(self._steps - 1, 0)
        arms = _POSTURE_GAIN_S * (self._rest_rad - body.qpos(snapshot)[TRUNK:])
        along = (body.jacobian(snapshot)[:, :TRUNK] @ trunk).reshape(-1, 6)
        qvel = body.joint_velocities(snapshot, self._twists_w(snapshot) + along, np.concatenate((trunk, arms)))
        action = body.to_action(snapshot, qvel, np.full((len(along), 2), self.opening_m))
        action = np.clip(env.control.of_joint_action(action, snapshot), -1.0, 1.0)
        return rounded(action, self._action_bits)

    def close(self) -> None:
        """Do nothing: a person has no process."""
        return

    def _twists_w(self, snapshot: Snapshot) -> np.ndarray:
        """Return (A, 6) velocities that lead towards the wanted poses."""
        back = np.stack([quat_conjugate(quat_from_matrix(turn)) for turn in snapshot.tool_rotation_w[0]])
        linear = self.positions_w - snapshot.tool_position_w[0]
        angular = quat_to_rotation_vector(quat_multiply(self.quaternions_w, back))
        twists = np.concatenate((_HAND_GAIN_S * linear, _TURN_GAIN_S * angular), axis=1)
        excess = np.abs(twists / self._most).max(axis=1, keepdims=True)
        return twists / np.maximum(excess, 1.0)  # slower, but in the same direction


class HandPanel:
    """What a person drives with: a button to take over, one and a key for each way, fingers, a gizmo at each hand.

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
        # a button, for a checkbox that was clicked keeps the keys to itself
        self._switch = gui.add_button(_DRIVE, hint="from the step that is shown")
        self._switch.on_click(lambda event: from_browser(event, do, lambda: switch(self._hand is None)))
        for (name, key), share in _WAYS.items():
            push = partial(do, partial(self._push, share))
            button = gui.add_button(f"{name} ({key})", hint="hold it")
            button.on_hold(lambda event, push=push: push(), callback_hz=10.0)
            gui.add_command(name, hotkey=key).on_trigger(lambda event, push=push: push())
        self._fingers = gui.add_slider(f"fingers (mm; {_FINGERS_KEY})", 0, _OPEN_MM, 1, _OPEN_MM)
        self._fingers.on_update(lambda event: from_browser(event, do, self._set_fingers))
        gui.add_command("fingers", hotkey=_FINGERS_KEY).on_trigger(lambda event: do(self._toggle_fingers))
        self._joins = gui.add_checkbox(f"both hands as one ({_PAIR_KEY})", initial_value=False, visible=False)
        self._joins.on_update(lambda event: from_browser(event, do, self._join))
        keys = f"{_NEARER_KEY}, {_FARTHER_KEY}"
        self._apart = gui.add_slider(f"apart (cm; {keys})", *_APART_CM, 1, _APART_CM[1], visible=False)
        self._apart.on_update(lambda event: from_browser(event, do, self._move_apart))
        gui.add_command("both hands as one", hotkey=_PAIR_KEY).on_trigger(lambda event: do(self._toggle_pair))
        for name, key, cm in (("hands nearer", _NEARER_KEY, -1), ("hands farther", _FARTHER_KEY, 1)):
            move = partial(do, partial(self._move_apart, cm))
            gui.add_command(name, hotkey=key).on_trigger(lambda event, move=move: move())
        self.note = gui.add_markdown("")

    def attach(self, hand: HandActor) -> None:
        """Have a hand go where the gizmos, buttons and keys say."""
        self.detach()
        self._hand = hand
        self._switch.label = _HAND_BACK
        self._set_fingers()
        self._joins.visible = len(hand.positions_w) == len(_RIGHT_LEFT)
        self._show_gizmos()

    def detach(self) -> None:
        """Let go, and take the gizmos away."""
        self._hand = None
        self._switch.label, self._joins.visible = _DRIVE, False
        self._show_gizmos()

    def follow(self) -> None:
        """Let the gizmos follow hands that have gone with the trunk."""
        hand = self._hand
        if hand is None or not hand.has_moved_on:  # else a person may be moving them
            return
        hand.has_moved_on = False
        for gizmo, (position, quaternion) in zip(self._gizmos, _wanted_poses(hand), strict=True):
            gizmo.position, gizmo.wxyz = position, quaternion

    def _show_gizmos(self) -> None:
        """Have one gizmo at each hand, or one between a pair; none while nobody drives."""
        for gizmo in self._gizmos:
            gizmo.remove()
        hand = self._hand
        is_pair = hand is not None and hand.pair is not None
        self._joins.value = self._apart.visible = is_pair
        poses = () if hand is None else _wanted_poses(hand)
        self._gizmos = [self._add_gizmo(number, *pose) for number, pose in enumerate(poses)]

    def _add_gizmo(self, number: int, position: np.ndarray, quaternion: np.ndarray) -> Any:
        """Return a gizmo; where it is moved to, the hand or the pair goes."""
        gizmo = self._server.scene.add_transform_controls(
            f"/hand-{number}", scale=_GIZMO_M, depth_test=False, position=position, wxyz=quaternion
        )

        def follow() -> None:
            hand = self._hand
            if hand is None:
                return
            if hand.pair is None:
                hand.positions_w[number], hand.quaternions_w[number] = gizmo.position, gizmo.wxyz
            else:
                hand.move_pair(gizmo.position, gizmo.wxyz, hand.pair.apart_m)

        gizmo.on_update(lambda event: from_browser(event, self._do, follow))
        return gizmo

    def _join(self) -> None:
        hand = self._hand
        if hand is None:
            return
        if self._joins.value:
            hand.join()
            assert hand.pair is not None
            self._apart.value = round(100 * hand.pair.apart_m)
        else:
            hand.pair = None
        self._show_gizmos()

    def _toggle_pair(self) -> None:
        self._joins.value = self._joins.visible and not self._joins.value
        self._join()

    def _move_apart(self, cm: int = 0) -> None:
        """Bring a pair of hands as far apart as the slider says, or so much farther."""
        hand = self._hand
        if hand is not None and hand.pair is not None:
            self._apart.value = min(max(self._apart.value + cm, _APART_CM[0]), _APART_CM[1])
            hand.move_pair(hand.pair.position_w, hand.pair.quaternion_w, self._apart.value / 100)

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


def _wanted_poses(hand: HandActor) -> Sequence[tuple[np.ndarray, np.ndarray]]:
    """Return position and quaternion of each gizmo."""
    if hand.pair is None:
        return list(zip(hand.positions_w, hand.quaternions_w, strict=True))
    return [(hand.pair.position_w, hand.pair.quaternion_w)]
