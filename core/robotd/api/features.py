"""Names for authors of features, which run beside a robot.

A feature, such as a page or a recorder, is a ``Feature`` in the entry-point group
``robotd.features``. It observes the robot through ``FeatureHost.tap``, the last seconds of its
frames and events, and may command it as any program does. ``examples/csv_feature`` is a whole one.
"""

from robotd.control.completion import Outcome
from robotd.control.joint_group import JointGroup
from robotd.control.problem import Problem, ProblemKind
from robotd.control.stream_setpoints import MovingReference
from robotd.control.trajectory_execution import TrajectoryExecution
from robotd.descriptor.section import Name, NotNegative, Positive, Section
from robotd.descriptor.section import Problem as SectionProblem
from robotd.descriptor.urdf import UrdfJoint, UrdfRobot, read_urdf, transform_numbers
from robotd.descriptor.urdf.urdf_model import frame
from robotd.device.motion_limits import MotionLimits
from robotd.device.process_image import FLAGS, NUMBERS, VALUES, ProcessImage
from robotd.device.tool_pose import tool_link
from robotd.errors import InvalidArgument, OperationError, RobotdError
from robotd.events import Event, EventKind, Level
from robotd.feature import Feature, FeatureOption
from robotd.feature_host import FeatureHost
from robotd.health.robot_health import Health
from robotd.motion import JointLimits, TrajectoryRequest
from robotd.observation.frame_ring import Frames
from robotd.observation.tap import Tap
from robotd.robot import Robot

__all__ = [
    "FLAGS",
    "NUMBERS",
    "VALUES",
    "Event",
    "EventKind",
    "Feature",
    "FeatureHost",
    "FeatureOption",
    "Frames",
    "Health",
    "InvalidArgument",
    "JointGroup",
    "JointLimits",
    "Level",
    "MotionLimits",
    "MovingReference",
    "Name",
    "NotNegative",
    "OperationError",
    "Outcome",
    "Positive",
    "Problem",
    "ProblemKind",
    "ProcessImage",
    "Robot",
    "RobotdError",
    "Section",
    "SectionProblem",
    "Tap",
    "TrajectoryExecution",
    "TrajectoryRequest",
    "UrdfJoint",
    "UrdfRobot",
    "frame",
    "read_urdf",
    "tool_link",
    "transform_numbers",
]
