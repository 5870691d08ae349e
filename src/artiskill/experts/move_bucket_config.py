"""Values of the expert of MoveBucket; they stand in `configs/experts/move_bucket.yaml`."""

import math
from dataclasses import dataclass

from artiskill.config import check_not_negative, check_positive, check_value, check_vector
from artiskill.experts.move_bucket_press import PressConfig
from artiskill.experts.whole_body import WholeBodyConfig


@dataclass(frozen=True)
class MoveBucketExpertConfig:
    """Distances, speeds and gains.

    Attributes:
        standoff_m: the fingertips stop this far from the wall before the hands close.
        hold_distance_m: from the robot's base to the bucket.
        position_gain_s: hand velocity per position error.
        rotation_gain_s: hand angular velocity per orientation error.
        posture_gain_s: joint velocity per posture error.
        carry_gain_s: bucket velocity per distance to its goal.
        approach_speed_m_s: of the hands, on their way to the bucket.
        close_speed_m_s: of the hands, from the standoff to the wall.
        touch_speed_m_s: of the hands, the last bit to the wall.
        press_n: force of each hand once both touch.
        lift_speed_m_s: of the bucket, upwards.
        carry_speed_m_s: of the bucket, sideways.
        carry_acceleration_m_s2: of the bucket.
        turn_speed_rad_s: of the hands.
        yaw_share: of the gain, about the vertical, while they touch: contacts turn them as well.
        level_gain_s: how fast the hands turn a bucket level that has tilted between them, per radian of tilt.
        aligned_m: position error below which the hands close.
        aligned_rad: orientation error below which they close.
        touching_m: distance of the fingertips from the wall below which a hand counts as touching.
        ramp_steps: environment steps of touching until they press with all of it.
        press_steps: environment steps of touching before the bucket is lifted.
        slip_m: distance of a hand from its place above which the bucket counts as lost.
        rise_m: how high the bucket is lifted.
        clear_m: it moves sideways once it is this high.
        inner_distance_m: how far from the platform's middle, on the robot's side, it is held.
        aside_m: how far from there to the robot's left.
        curve_rad_m: it is carried this far aside of that place, per metre from it: in a curve.
        finger_position_m: of each finger, open, for two places of contact per hand.
        arm_qpos_rad: preferred posture of the right arm; the left one's is its mirror image.
        lift_below_hand_m: preferred height of the hands above the lift's position.
        press: where to press.
        whole_body: weights of the inverse kinematics.
    """

    standoff_m: float
    hold_distance_m: float
    position_gain_s: float
    rotation_gain_s: float
    posture_gain_s: float
    carry_gain_s: float
    approach_speed_m_s: float
    close_speed_m_s: float
    touch_speed_m_s: float
    press_n: float
    lift_speed_m_s: float
    carry_speed_m_s: float
    carry_acceleration_m_s2: float
    turn_speed_rad_s: float
    yaw_share: float
    level_gain_s: float
    aligned_m: float
    aligned_rad: float
    touching_m: float
    ramp_steps: int
    press_steps: int
    slip_m: float
    rise_m: float
    clear_m: float
    inner_distance_m: float
    aside_m: float
    curve_rad_m: float
    finger_position_m: float
    arm_qpos_rad: tuple[float, ...]
    lift_below_hand_m: float
    press: PressConfig
    whole_body: WholeBodyConfig

    def __post_init__(self) -> None:
        check_positive(self, "standoff_m", "hold_distance_m", "rise_m", "clear_m", "slip_m", "touching_m")
        check_positive(self, "position_gain_s", "rotation_gain_s", "posture_gain_s", "carry_gain_s")
        check_positive(self, "approach_speed_m_s", "close_speed_m_s", "touch_speed_m_s", "turn_speed_rad_s")
        check_positive(self, "lift_speed_m_s", "carry_speed_m_s", "carry_acceleration_m_s2", "press_n")
        check_positive(self, "aligned_m", "aligned_rad", "ramp_steps", "press_steps")
        check_not_negative(self, "inner_distance_m", "finger_position_m", "lift_below_hand_m")
        check_not_negative(self, "yaw_share", "level_gain_s")
        check_vector(self, "arm_qpos_rad", size=7)
        for name in ("aside_m", "curve_rad_m"):
            check_value(self, name, math.isfinite(getattr(self, name)), "must be finite")
