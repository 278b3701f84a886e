"""Pure functions and values of motion: trajectories, limits, tolerances. No ROS, no clock.

``plan`` turns a ``TrajectoryRequest`` into a ``Trajectory``; a ``Sampler`` reads it in the
cycle; ``plan_stop`` ends it early, along its path.
"""

from robotd.motion.interpolation import Interpolation
from robotd.motion.joints import JointLimits, MotionState, TrajectoryRules
from robotd.motion.limits import AxisLimits, check_jog, check_move
from robotd.motion.planning import plan
from robotd.motion.rate_bounds import RateBounds
from robotd.motion.rejection import RejectionCode, TrajectoryRejected
from robotd.motion.request import TrajectoryRequest
from robotd.motion.spline_points import spline_points
from robotd.motion.stopping import StopPlan, plan_stop
from robotd.motion.tolerance import (
    JointTolerance,
    Tolerances,
    Violation,
)
from robotd.motion.trajectory import Sampler, Trajectory

__all__ = [
    "AxisLimits",
    "Interpolation",
    "JointLimits",
    "JointTolerance",
    "MotionState",
    "RateBounds",
    "RejectionCode",
    "Sampler",
    "StopPlan",
    "Tolerances",
    "Trajectory",
    "TrajectoryRejected",
    "TrajectoryRequest",
    "TrajectoryRules",
    "Violation",
    "check_jog",
    "check_move",
    "plan",
    "plan_stop",
    "spline_points",
]
