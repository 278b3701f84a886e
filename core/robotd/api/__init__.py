"""Names for authors of plugins; those of a backend here. Changing them changes ``API_VERSION``.

A backend is a module with hooks (``hookimpl``); it makes drivers (``DeviceDriver``,
``AxisDriver``, ``IoDriver``, ``FieldbusDriver``) for one robot (``DeviceContext``). Units, the
checks of the core, thread rules and errors of drivers: ``help("robotd.device.drivers")``. Hooks:
``help("robotd.plugin.hookspecs")``. Features: ``help(Capability)``. Names for ROS nodes of a
backend are in ``robotd_ros.api``.

What all authors need is here, too: errors, arrays, clock, log. Further names, by reader:
``robotd.api.features``, ``.robots``, ``.models``, ``.commands`` and ``.bases``. In each of these
modules a name is imported when it is first read, so that importing the module costs nothing.
"""

from typing import TYPE_CHECKING

from robotd.lazy_names import lazy_names

if TYPE_CHECKING:
    from robotd.arrays import BoolArray, FloatArray, IntArray
    from robotd.clock import NANOSECONDS, Clock, MonotonicClock, wait_until
    from robotd.clock.simulated import ticks, untimed
    from robotd.descriptor import RobotDescriptor, load_robot_descriptor, validate_section
    from robotd.descriptor.files import read_limited
    from robotd.descriptor.urdf import (
        GravityModel,
        UrdfJoint,
        UrdfLink,
        UrdfRobot,
        read_urdf,
        read_urdf_text,
    )
    from robotd.descriptor.urdf.package_files import find_mesh
    from robotd.descriptor.validation_errors import validate
    from robotd.descriptor.yaml_tree import read_yaml
    from robotd.device.bus_status import BusNode, BusState, BusStatus
    from robotd.device.camera_picture import due_cameras, jpeg
    from robotd.device.capabilities import Capability
    from robotd.device.drivers import AxisDriver, DeviceDriver, FieldbusDriver, IoDriver
    from robotd.device.fault_injector import FaultInjector
    from robotd.device.fieldbus import object_bytes, object_text
    from robotd.device.passive_joints import DrivenFingers, PassiveJoints
    from robotd.device.payload import Payload, PayloadDriver
    from robotd.device.process_image import ProcessImage
    from robotd.device.profiled_axes import ProfiledAxes
    from robotd.device.state import (
        EXTRAPOLATION_PERIODS,
        CommandMode,
        ConnectionState,
        Operation,
        Underrun,
    )
    from robotd.device.world import Shape, World, WorldCamera, WorldObject
    from robotd.device.wrench import WrenchDriver
    from robotd.entry_points import API_VERSION
    from robotd.errors import (
        ConnectError,
        DescriptorError,
        DeviceTimeout,
        InvalidArgument,
        LateSetpoint,
        NotReady,
        OperationError,
        PluginError,
        RecordingError,
        RobotdError,
        Unsupported,
        did_you_mean,
        reason_of,
        unknown_name,
    )
    from robotd.log import get_logger
    from robotd.motion.limits import AxisLimits
    from robotd.motion.profile import (
        Profile,
        Segment,
        profile_to_position,
        profile_to_rest,
        profile_to_velocity,
    )
    from robotd.number_argument import IntegerRange, NumberRange, ObjectNumber
    from robotd.observation.frame_ring import Frames
    from robotd.plugin.code_table import CodeTable
    from robotd.plugin.hookspecs import (
        AxisKeys,
        BackendInfo,
        BackendOptions,
        DeviceContext,
        hookimpl,
    )
    from robotd.plugin.machine_checks import (
        Finding,
        MachineContext,
        diagnose,
        doctors,
        scan_network,
    )
    from robotd.plugin.parameter_reader import ParameterReader, no_parameters
    from robotd.plugin.registry import NodeRegistry, RobotRegistry
    from robotd.realtime import request_realtime
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "API_VERSION",
    "EXTRAPOLATION_PERIODS",
    "NANOSECONDS",
    "AxisDriver",
    "AxisKeys",
    "AxisLimits",
    "BackendInfo",
    "BackendOptions",
    "BoolArray",
    "BusNode",
    "BusState",
    "BusStatus",
    "Capability",
    "Clock",
    "CodeTable",
    "CommandMode",
    "ConnectError",
    "ConnectionState",
    "DescriptorError",
    "DeviceContext",
    "DeviceDriver",
    "DeviceTimeout",
    "DrivenFingers",
    "FaultInjector",
    "FieldbusDriver",
    "Finding",
    "FloatArray",
    "Frames",
    "GravityModel",
    "IntArray",
    "IntegerRange",
    "InvalidArgument",
    "IoDriver",
    "LateSetpoint",
    "MachineContext",
    "MonotonicClock",
    "NodeRegistry",
    "NotReady",
    "NumberRange",
    "ObjectNumber",
    "Operation",
    "OperationError",
    "ParameterReader",
    "PassiveJoints",
    "Payload",
    "PayloadDriver",
    "PluginError",
    "ProcessImage",
    "Profile",
    "ProfiledAxes",
    "RecordingError",
    "RobotDescriptor",
    "RobotRegistry",
    "RobotdError",
    "Segment",
    "Shape",
    "Underrun",
    "Unsupported",
    "UrdfJoint",
    "UrdfLink",
    "UrdfRobot",
    "World",
    "WorldCamera",
    "WorldObject",
    "WrenchDriver",
    "diagnose",
    "did_you_mean",
    "doctors",
    "due_cameras",
    "find_mesh",
    "get_logger",
    "hookimpl",
    "jpeg",
    "lazy_names",
    "load_robot_descriptor",
    "no_parameters",
    "object_bytes",
    "object_text",
    "profile_to_position",
    "profile_to_rest",
    "profile_to_velocity",
    "read_limited",
    "read_urdf",
    "read_urdf_text",
    "read_yaml",
    "reason_of",
    "request_realtime",
    "scan_network",
    "ticks",
    "unknown_name",
    "untimed",
    "validate",
    "validate_section",
    "wait_until",
]
