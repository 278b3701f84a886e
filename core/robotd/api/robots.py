"""Names for programs that make robots, run them and command them.

``open_robot`` gives a started robot. A program that needs more makes it from a descriptor
(``robotd.api.models``), a backend (``load_backend``) and a clock: a ``SteppedClock`` runs a
simulation step by step, a ``PacedClock`` at any speed. Axes, joint groups, streams, the gripper and
the base of a robot take commands; all values are SI. ``robotd_gym`` is a short example.
"""

from typing import TYPE_CHECKING

from robotd.lazy_names import lazy_names

if TYPE_CHECKING:
    from robotd.clock.simulated import PacedClock, SimulatedClock, SteppedClock
    from robotd.control.groups.descriptor_limits import axis_limits, joint_limits, twist_limits
    from robotd.control.groups.joint_group import JointGroup
    from robotd.control.groups.joint_stream import JointStream
    from robotd.control.groups.mobile_base import MobileBase
    from robotd.control.groups.problem import Problem, ProblemKind
    from robotd.control.groups.reduced_speed import ReducedSpeed
    from robotd.control.loop.rearming import Interruption
    from robotd.control.loop.setpoint_source import Outcome
    from robotd.control.sources.contact import Contact, ContactLimits, WrenchAxis, WrenchLimits
    from robotd.control.sources.stream_source import MovingReference, StreamMode
    from robotd.control.sources.trajectory_execution import TrajectoryExecution
    from robotd.device.axes import Jog, Move, each
    from robotd.device.gripper import Gripper
    from robotd.device.motion_limits import Factors, MotionLimits, Solid
    from robotd.device.servo_gripper import ServoGripper
    from robotd.device.tool_pose import tool_link
    from robotd.device.wrench import Wrench, Wrenches, WrenchSensor
    from robotd.entry_points import PluginOrigin
    from robotd.log import configure_logging
    from robotd.motion import (
        JointLimits,
        JointTolerance,
        RateBounds,
        Trajectory,
        TrajectoryRejected,
        TrajectoryRequest,
    )
    from robotd.motion.planar import ZERO_TWIST, PlanarTwist
    from robotd.motion.rejection import distinct, reject
    from robotd.motion.stopping import stoppable_velocity
    from robotd.plugin.manager import (
        Backend,
        discover,
        find_backend,
        load_backend,
        load_plugins,
    )
    from robotd.robot import Robot, build_robot, open_robot
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "ZERO_TWIST",
    "Backend",
    "Contact",
    "ContactLimits",
    "Factors",
    "Gripper",
    "Interruption",
    "Jog",
    "JointGroup",
    "JointLimits",
    "JointStream",
    "JointTolerance",
    "MobileBase",
    "MotionLimits",
    "Move",
    "MovingReference",
    "Outcome",
    "PacedClock",
    "PlanarTwist",
    "PluginOrigin",
    "Problem",
    "ProblemKind",
    "RateBounds",
    "ReducedSpeed",
    "Robot",
    "ServoGripper",
    "SimulatedClock",
    "Solid",
    "SteppedClock",
    "StreamMode",
    "Trajectory",
    "TrajectoryExecution",
    "TrajectoryRejected",
    "TrajectoryRequest",
    "Wrench",
    "WrenchAxis",
    "WrenchLimits",
    "WrenchSensor",
    "Wrenches",
    "axis_limits",
    "build_robot",
    "configure_logging",
    "discover",
    "distinct",
    "each",
    "find_backend",
    "joint_limits",
    "load_backend",
    "load_plugins",
    "open_robot",
    "reject",
    "stoppable_velocity",
    "tool_link",
    "twist_limits",
]
