"""All that a backend may import from robotd. Changing it changes ``API_VERSION``."""

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS, Clock, MonotonicClock, wait_until
from robotd.descriptor import (
    RobotDescriptor,
    WmxParameters,
    axis_text,
    default_wmx_parameters,
    load_robot_descriptor,
    read_wmx_parameters,
    require_same_scaling,
    validate_section,
    write_wmx_parameters,
)
from robotd.descriptor.files import read_limited
from robotd.device.capabilities import Capability
from robotd.device.drivers import (
    AxisDriver,
    DeviceDriver,
    FieldbusDriver,
    IoDriver,
    NetworkState,
    SlaveInfo,
)
from robotd.device.fault_injector import FaultInjector
from robotd.device.process_image import ProcessImage
from robotd.device.state import CommandMode, ConnectionState, Operation
from robotd.errors import (
    ConnectError,
    DescriptorError,
    DeviceTimeout,
    InvalidArgument,
    NotReady,
    OperationError,
    PluginError,
    RobotdError,
    Unsupported,
)
from robotd.log import get_logger
from robotd.motion.profile import (
    Profile,
    Segment,
    profile_to_position,
    profile_to_rest,
    profile_to_velocity,
)
from robotd.plugin.hookspecs import (
    API_VERSION,
    BackendInfo,
    BackendOptions,
    DeviceContext,
    hookimpl,
)
from robotd.plugin.registry import NodeRegistry, RobotRegistry
from robotd.realtime import request_realtime

__all__ = [
    "API_VERSION",
    "NANOSECONDS",
    "AxisDriver",
    "BackendInfo",
    "BackendOptions",
    "Capability",
    "Clock",
    "CommandMode",
    "ConnectError",
    "ConnectionState",
    "DescriptorError",
    "DeviceContext",
    "DeviceDriver",
    "DeviceTimeout",
    "FaultInjector",
    "FieldbusDriver",
    "FloatArray",
    "InvalidArgument",
    "IoDriver",
    "MonotonicClock",
    "NetworkState",
    "NodeRegistry",
    "NotReady",
    "Operation",
    "OperationError",
    "PluginError",
    "ProcessImage",
    "Profile",
    "RobotDescriptor",
    "RobotRegistry",
    "RobotdError",
    "Segment",
    "SlaveInfo",
    "Unsupported",
    "WmxParameters",
    "axis_text",
    "default_wmx_parameters",
    "get_logger",
    "hookimpl",
    "load_robot_descriptor",
    "profile_to_position",
    "profile_to_rest",
    "profile_to_velocity",
    "read_limited",
    "read_wmx_parameters",
    "request_realtime",
    "require_same_scaling",
    "validate_section",
    "wait_until",
    "write_wmx_parameters",
]
