"""Settings of ``wmx_engine_node`` and ``wmx_core_motion_node``."""

from __future__ import annotations

from robotd.control.axis_limits import axis_limits, axis_names
from robotd.descriptor import RobotDescriptor
from robotd.node_settings.parameter_reader import ParameterReader


def read_core_motion(parameters: ParameterReader, descriptor: RobotDescriptor) -> str:
    """Declare what clients read of the axes, and ``frame_prefix``, which is returned."""
    names = axis_names(descriptor)
    parameters.same_as("joints", "axis_names", names, "names of the axes by index")
    units = [limits.unit for limits in axis_limits(descriptor)]
    parameters.same_as("joints", "axis_units", units, "rad or m of the axes by index")
    return read_frame_prefix(parameters)


def read_frame_prefix(parameters: ParameterReader) -> str:
    """Declare ``frame_prefix`` and return it."""
    return parameters.text("frame_prefix", "", "put before the names of all frames")


def read_engine(parameters: ParameterReader, descriptor: RobotDescriptor) -> bool:
    """Declare ``managed`` and return it."""
    return parameters.flag("managed", False, "a lifecycle manager starts and stops the robot")
