"""Settings of ``robot_state_publisher``: the URDF, and the frames made of it."""

from __future__ import annotations

from typing import NamedTuple

from robotd.descriptor import RobotDescriptor
from robotd.node_settings.device_settings import read_frame_prefix
from robotd.node_settings.parameter_reader import ParameterReader

RATE_HZ = 50.0


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
        "publish_frequency", RATE_HZ, f"rate of the moving frames in Hz; at most {highest:g}"
    )
    if rate_hz > highest:
        parameters.reject("publish_frequency", f"{rate_hz:g} is above {highest:g}")
    return StatePublisherSettings(
        description,
        read_frame_prefix(parameters),
        rate_hz,
    )
