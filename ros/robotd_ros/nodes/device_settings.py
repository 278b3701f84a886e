"""Settings of the nodes of any robot: engine, axes, and transforms."""

from __future__ import annotations

from typing import NamedTuple

from robotd.control.groups.descriptor_limits import axis_limits, axis_names
from robotd.descriptor import RobotDescriptor
from robotd.plugin.parameter_reader import ParameterReader, wrong_frame

TRANSFORM_RATE_HZ = 50.0


def read_core_motion(parameters: ParameterReader, descriptor: RobotDescriptor) -> str:
    """Declare what clients read of the axes, and ``frame_prefix``, which is returned."""
    names = axis_names(descriptor)
    parameters.same_as("joints", "axis_names", names, "names of the axes by index")
    units = [limits.unit for limits in axis_limits(descriptor)]
    parameters.same_as("joints", "axis_units", units, "rad or m of the axes by index")
    return read_frame_prefix(parameters)


def read_frame_prefix(parameters: ParameterReader) -> str:
    """Declare ``frame_prefix`` and return it."""
    prefix = parameters.text("frame_prefix", "", "put before the names of all frames")
    if prefix and (wrong := wrong_frame(prefix)):
        parameters.reject("frame_prefix", f"{prefix!r} cannot begin a frame: {wrong}")
    return prefix


def read_engine(parameters: ParameterReader, descriptor: RobotDescriptor) -> bool:
    """Declare ``managed`` and return it."""
    return parameters.flag("managed", False, "a lifecycle manager starts and stops the robot")


class StatePublisherSettings(NamedTuple):
    """Settings of ``robot_state_publisher``.

    Attributes:
        description: the URDF; "" only where it is read without ROS.
        prefix: of the names of all frames.
        rate_hz: of the moving frames.
    """

    description: str
    prefix: str
    rate_hz: float


def read_state_publisher(
    parameters: ParameterReader, descriptor: RobotDescriptor
) -> StatePublisherSettings:
    """Declare the parameters of ``robot_state_publisher``."""
    description = parameters.description()
    if not description and descriptor.urdf is None:
        parameters.reject("robot_description", f"{descriptor.name} has no urdf")
    highest = descriptor.cycle.rate_hz
    rate_hz = parameters.positive(
        "publish_frequency",
        TRANSFORM_RATE_HZ,
        f"rate of the moving frames in Hz; at most {highest:g}",
    )
    if rate_hz > highest:
        parameters.reject("publish_frequency", f"{rate_hz:g} is above {highest:g}")
    return StatePublisherSettings(
        description,
        read_frame_prefix(parameters),
        rate_hz,
    )
