"""MuJoCo backend: a simulated robot with gravity, contacts and objects around it.

The hooks are here; ``physics.py`` has the state, ``robot_model.py`` what is simulated. MuJoCo
itself is imported with the first device.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from robotd.api import (
    AxisDriver,
    BackendInfo,
    Capability,
    DeviceContext,
    DeviceDriver,
    FaultInjector,
    IoDriver,
    NodeRegistry,
    PassiveJoints,
    PayloadDriver,
    PluginError,
    World,
    WrenchDriver,
    hookimpl,
)
from robotd_mujoco.options import MujocoOptions

if TYPE_CHECKING:
    from robotd_mujoco.device import MujocoDevice


@hookimpl
def robotd_backend() -> BackendInfo:
    """Streams positions and velocities; there is no fieldbus."""
    return BackendInfo(
        summary="simulated robot with gravity, contacts and objects (MuJoCo)",
        api_version=1,
        capabilities=frozenset(
            {
                Capability.VELOCITY_MODE,
                Capability.HAND_GUIDING,
                Capability.SIMULATED,
                Capability.CONTACTS,
            }
        ),
        options=MujocoOptions,
    )


@hookimpl
def robotd_register_nodes(registry: NodeRegistry) -> None:
    """Add the node of the cameras, the wrist and the true pose of a base."""
    registry.add(
        "mujoco",
        "robotd_mujoco.node:MujocoNode",
        summary="cameras of the scene, force at the wrist, true pose of a base",
        parameters="robotd.plugin.parameter_reader:no_parameters",
    )


@hookimpl
def robotd_open_device(context: DeviceContext[MujocoOptions]) -> DeviceDriver:
    """Make a robot at rest, at the initial position of its options.

    Raises PluginError: MuJoCo is not installed.
    """
    try:
        from robotd_mujoco.device import MujocoDevice
        from robotd_mujoco.physics import Physics
    except ModuleNotFoundError as error:
        if error.name != "mujoco":
            raise
        text = "the backend mujoco needs MuJoCo: pip install 'robotd[mujoco]'"
        raise PluginError(text) from error
    return MujocoDevice(Physics(context.robot, context.options, context.clock))


@hookimpl
def robotd_axes(device: MujocoDevice, context: DeviceContext[MujocoOptions]) -> AxisDriver:
    """One drive per axis."""
    from robotd_mujoco.device import MujocoAxes

    return MujocoAxes(device.physics, context)


@hookimpl
def robotd_io(device: MujocoDevice) -> IoDriver:
    """Two images, whether or not the robot has an I/O module."""
    from robotd_mujoco.device import MujocoIo

    return MujocoIo(device.physics)


@hookimpl
def robotd_passive_joints(
    device: MujocoDevice, context: DeviceContext[MujocoOptions]
) -> PassiveJoints | None:
    """The fingers, where the model has them."""
    from robotd_mujoco.device import MujocoFingers

    gripper = context.robot.gripper
    if gripper is None or not device.physics.robot_model.fingers:
        return None
    return MujocoFingers(device.physics, gripper.joints)


@hookimpl
def robotd_payload(device: MujocoDevice) -> PayloadDriver | None:
    """The weight at the last link, where there is one arm."""
    from robotd_mujoco.payload import MujocoPayload

    return None if device.physics.robot_model.payload < 0 else MujocoPayload(device.physics)


@hookimpl
def robotd_wrenches(device: MujocoDevice) -> WrenchDriver | None:
    """The force/torque sensors at the wrists of the arms; None without an arm."""
    from robotd_mujoco.device import MujocoWrenches

    return MujocoWrenches(device.physics) if device.physics.robot_model.wrists else None


@hookimpl
def robotd_world(device: MujocoDevice) -> World:
    """The objects of the scene; there may be none."""
    from robotd_mujoco.device import MujocoWorld

    return MujocoWorld(device.physics)


@hookimpl
def robotd_fault_injector(device: MujocoDevice) -> FaultInjector:
    """Fault injection into drives, link and inputs."""
    from robotd_mujoco.fault_injector import MujocoFaultInjector

    return MujocoFaultInjector(device.physics)
