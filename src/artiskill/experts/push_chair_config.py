"""Values of the expert of PushChair; they stand in `configs/experts/push_chair.yaml`."""

import math
from dataclasses import dataclass

from artiskill.config import check, check_inside, check_not_negative, check_positive, check_value, check_vector
from artiskill.experts.whole_body import WholeBodyConfig


@dataclass(frozen=True)
class PushChairExpertConfig:
    """Distances, speeds and gains.

    Attributes:
        side_bias_rad: the side to stand on is chosen as if the robot were so far around the chair,
            counter-clockwise; 0 for the nearest one.
        oblique_rad: how far aside of straight ahead a hand alone pushes.
        grip_height_share: where on the free part of a post hands grip: -1 lowest, 0 usual, 1 highest.
        base_distance_m: of the base from the middle of what the hands go for.
        around_distance_m: the same while the base drives around the chair.
        around_step_rad: how far ahead on that circle it steers.
        around_face_rad: on its way around it faces as in its place, but away from the chair by so much at most.
        base_speed_share: of the base's highest speed, while no hand grips.
        toe_in_rad: how far a hand that grips in front of the robot points inwards.
        pair_toe_in_rad: the same where each hand has a post of its own.
        arm_rad: posture of the right arm, mirrored for the left; elbow and wrist are as low as
            the hand, under the seat.
        pitch_rad: how far the hands point upwards, so that their wrists stay clear of the seat.
        carry_m: where the hands are carried, forward and sideways of the base.
        standoff_m: the hand stops this far in front of the post before it reaches around it.
        idle_m: a hand that does not grip stays this far from the post.
        shoulder_above_m: height of a grip above which the lift goes up.
        position_gain_s: hand velocity per position error.
        rotation_gain_s: hand angular velocity per orientation error.
        posture_gain_s: velocity of base and lift per error.
        arm_gain_s: joint velocity per error of the arms' posture, where one hand grips.
        pair_arm_gain_s: the same where both do.
        hand_speed_m_s: of a free hand.
        reach_speed_m_s: of a hand, from the standoff to the post.
        turn_speed_rad_s: of a hand.
        carried_m: error of the base and the hands' height below which the hands go in.
        aligned_m: hand's error at the standoff below which it reaches.
        aligned_rad: likewise, of its orientation.
        patience_steps: after so many steps twice these errors will do, and so on.
        grip_m: distance to the post's axis below which the fingers close.
        reach_steps: after so many steps of reaching in vain it tries anew, in its usual manner.
        stray_m: a reaching hand that is this far aside of its way goes back and tries anew.
        slip_m: distance to the post's axis above which a grip counts as lost.
        grip_steps: environment steps that the fingers get to close.
        close_speed_m_s: of each finger.
        drive_speed_m_s: of the chair, at most.
        curve_rad_m: the chair is driven this far aside of its target, per metre from it: in a curve.
        steer_rad_s: a robot that grips with one hand goes around the post with the way, so fast at most.
        drive_gain_s: speed per distance from the target.
        drive_acceleration_m_s2: of the chair, at most.
        stop_m: distance to the target at which the chair is held where it is.
        leave_m: distance from which it is driven again.
        whole_body: weights of the inverse kinematics.
    """

    side_bias_rad: float
    oblique_rad: float
    grip_height_share: float
    base_distance_m: float
    around_distance_m: float
    around_step_rad: float
    around_face_rad: float
    base_speed_share: float
    toe_in_rad: float
    pair_toe_in_rad: float
    arm_rad: tuple[float, ...]
    pitch_rad: float
    carry_m: tuple[float, float]
    standoff_m: float
    idle_m: float
    shoulder_above_m: float
    position_gain_s: float
    rotation_gain_s: float
    posture_gain_s: float
    arm_gain_s: float
    pair_arm_gain_s: float
    hand_speed_m_s: float
    reach_speed_m_s: float
    turn_speed_rad_s: float
    carried_m: float
    aligned_m: float
    aligned_rad: float
    patience_steps: int
    grip_m: float
    reach_steps: int
    stray_m: float
    slip_m: float
    grip_steps: int
    close_speed_m_s: float
    drive_speed_m_s: float
    curve_rad_m: float
    steer_rad_s: float
    drive_gain_s: float
    drive_acceleration_m_s2: float
    stop_m: float
    leave_m: float
    whole_body: WholeBodyConfig

    def __post_init__(self) -> None:
        check_not_negative(self, "steer_rad_s")
        check_inside("grip_height_share", self.grip_height_share, (-1, 1))
        check_inside("base_speed_share", self.base_speed_share, (0.1, 1))
        check_inside("around_face_rad", self.around_face_rad, (0, math.pi))
        check_positive(self, "base_distance_m", "around_distance_m", "around_step_rad", "standoff_m", "idle_m")
        check_positive(self, "position_gain_s", "rotation_gain_s", "posture_gain_s", "drive_gain_s")
        check_positive(self, "hand_speed_m_s", "reach_speed_m_s", "turn_speed_rad_s", "close_speed_m_s")
        check_positive(self, "drive_speed_m_s", "drive_acceleration_m_s2", "carried_m", "stop_m", "leave_m")
        check_positive(self, "grip_m", "aligned_m", "aligned_rad", "stray_m", "slip_m")
        check_positive(self, "patience_steps", "reach_steps", "grip_steps")
        check_not_negative(self, "arm_gain_s", "pair_arm_gain_s", "shoulder_above_m")
        check_vector(self, "arm_rad", size=7)
        check_vector(self, "carry_m", size=2)
        check_value(self, "curve_rad_m", math.isfinite(self.curve_rad_m), "must be finite")
        for name in ("side_bias_rad", "oblique_rad", "toe_in_rad", "pair_toe_in_rad", "pitch_rad"):
            check_inside(name, getattr(self, name), (-math.pi, math.pi))
        check(self.stop_m < self.leave_m, f"stop_m = {self.stop_m} must be below leave_m = {self.leave_m}")
