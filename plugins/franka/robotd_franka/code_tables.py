"""Modes, reflexes and errors of the arm as alarms with remedies.

Those from 100 on are 100 + the number of an error on the wire of FCI.
"""

from __future__ import annotations

from collections.abc import Sequence

from robotd.api import CodeTable

# Numbers of RobotMode.
OTHER, IDLE, MOVE, GUIDING, REFLEX, USER_STOPPED, RECOVERY = range(7)

NOT_READY = 1  # alarm of the mode OTHER, whose number is 0
FIRST_ERROR = 100

ERRORS = (
    "joint_position_limits_violation",
    "cartesian_position_limits_violation",
    "self_collision_avoidance_violation",
    "joint_velocity_violation",
    "cartesian_velocity_violation",
    "force_control_safety_violation",
    "joint_reflex",
    "cartesian_reflex",
    "max_goal_pose_deviation_violation",
    "max_path_pose_deviation_violation",
    "cartesian_velocity_profile_safety_violation",
    "joint_position_motion_generator_start_pose_invalid",
    "joint_motion_generator_position_limits_violation",
    "joint_motion_generator_velocity_limits_violation",
    "joint_motion_generator_velocity_discontinuity",
    "joint_motion_generator_acceleration_discontinuity",
    "cartesian_position_motion_generator_start_pose_invalid",
    "cartesian_motion_generator_elbow_limit_violation",
    "cartesian_motion_generator_velocity_limits_violation",
    "cartesian_motion_generator_velocity_discontinuity",
    "cartesian_motion_generator_acceleration_discontinuity",
    "cartesian_motion_generator_elbow_sign_inconsistent",
    "cartesian_motion_generator_start_elbow_invalid",
    "force_controller_desired_force_tolerance_violation",
    "start_elbow_sign_inconsistent",
    "communication_constraints_violation",
    "power_limit_violation",
    "cartesian_motion_generator_joint_position_limits_violation",
    "cartesian_motion_generator_joint_velocity_limits_violation",
    "cartesian_motion_generator_joint_velocity_discontinuity",
    "cartesian_motion_generator_joint_acceleration_discontinuity",
    "cartesian_position_motion_generator_invalid_frame",
    "controller_torque_discontinuity",
    "joint_p2p_insufficient_torque_for_planning",
    "tau_j_range_violation",
    "instability_detected",
    "joint_move_in_wrong_direction",
    "cartesian_spline_motion_generator_violation",
    "joint_via_motion_generator_planning_joint_limit_violation",
    "base_acceleration_initialization_timeout",
    "base_acceleration_invalid_reading",
)

TEXTS = {
    NOT_READY: "the arm is not ready for FCI",
    REFLEX: "reflex: the arm has stopped by itself",
    USER_STOPPED: "user stop",
    RECOVERY: "the arm recovers from an error",
} | {FIRST_ERROR + place: f"reflex: {name}" for place, name in enumerate(ERRORS)}

RESET = "look for the cause, then reset (robotd recover); nothing moves by that"
BY_HAND = "the arm has to be led back by hand or in Desk"
COLLISION = (
    "a collision, a wrong load (load_kg, or the end effector in Desk), or thresholds that are too"
    " low (collision_torque_nm, collision_force_n); then reset"
)
REMEDIES = {
    NOT_READY: "open the brakes and activate FCI in Desk; no other program may move the arm",
    REFLEX: RESET,
    USER_STOPPED: "release the stop button or the enabling device at the arm",
    RECOVERY: "wait for its end",
    FIRST_ERROR + ERRORS.index("joint_reflex"): COLLISION,
    FIRST_ERROR + ERRORS.index("cartesian_reflex"): COLLISION,
    FIRST_ERROR + ERRORS.index("communication_constraints_violation"): (
        "packets were late: a PREEMPT_RT kernel, a cable of its own, no power saving"
        " (robotd doctor --backend franka); then reset"
    ),
    FIRST_ERROR + ERRORS.index("joint_position_limits_violation"): BY_HAND,
    FIRST_ERROR + ERRORS.index("self_collision_avoidance_violation"): BY_HAND,
}


def remedy(code: int) -> str:
    """Return what to do about an alarm; "" for a code that does not exist."""
    return REMEDIES.get(code, RESET if code in TEXTS else "")


ALARMS = CodeTable("alarm of a Franka arm", TEXTS, remedy=remedy, digits=0)


def alarm_of(mode: int, errors: Sequence[str] = ()) -> tuple[int, str]:
    """Return number and text of the alarm of a mode; 0 and "" where the arm can be used.

    Judged by the mode: the errors of a reflex are cleared when the arm has come to rest, and the
    reflex stays. ``errors``: names, of which the first gives the number.
    """
    if mode in (IDLE, MOVE, GUIDING):
        return 0, ""
    code = NOT_READY if mode == OTHER else mode
    if mode == REFLEX and errors:
        code = FIRST_ERROR + ERRORS.index(errors[0]) if errors[0] in ERRORS else REFLEX
    names = f" ({', '.join(errors)})" if len(errors) > 1 else ""
    return code, f"{TEXTS.get(code, f'mode {mode}')}{names}: {remedy(code)}"
