"""The simulation with measured fingers, one cube, and a node of its own: a world as a plugin."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from robotd.api import (
    BackendInfo,
    Capability,
    DeviceContext,
    DeviceDriver,
    FloatArray,
    InvalidArgument,
    NodeRegistry,
    PassiveJoints,
    Shape,
    World,
    WorldObject,
    hookimpl,
)
from robotd.plugin.manager import Backend, PluginOrigin
from robotd_sim import SimAxes, SimDevice, SimIo, SimOptions, Simulation

NODE = "cubes"
START = (0.4, 0.0, 0.02, 0.0, 0.0, 0.0, 1.0)


class CubeDevice(SimDevice):
    """Device with what its world and its node share."""

    cube: FloatArray = np.array(START)
    fingers: FloatArray = np.array([0.01, 0.02])


class Fingers(PassiveJoints):
    def __init__(self, device: CubeDevice) -> None:
        self._device = device

    @property
    def names(self) -> Sequence[str]:
        return ["picker_2_joint", "picker_1_joint"]  # not in the order of the robot's file

    def read(self, positions: FloatArray) -> None:
        positions[:] = self._device.fingers


class Cubes(World):
    def __init__(self, device: CubeDevice) -> None:
        self._device = device

    @property
    def frame(self) -> str:
        return "base_link"

    @property
    def objects(self) -> Sequence[WorldObject]:
        return [WorldObject("cube", Shape.BOX, (0.04, 0.04, 0.04), (1.0, 0.0, 0.0, 1.0), True)]

    def poses(self) -> FloatArray:
        return self._device.cube[None].copy()

    def reset(self) -> None:
        self._device.cube = np.array(START)

    def place(self, name: str, pose: FloatArray) -> None:
        if pose[2] < 0.0:
            raise InvalidArgument(f"{name}: z is {pose[2]:g}, below the floor")
        self._device.cube = np.array(pose)


class CubeBackend:
    """Hooks; the node is registered by the backend itself."""

    @hookimpl
    def robotd_backend(self) -> BackendInfo:
        return BackendInfo("cubes", 1, frozenset({Capability.SIMULATED}), SimOptions)

    @hookimpl
    def robotd_register_nodes(self, registry: NodeRegistry) -> None:
        registry.add(NODE, "tests.world_backend:make_node", summary="tells where the cube is")

    @hookimpl
    def robotd_open_device(self, context: DeviceContext[SimOptions]) -> DeviceDriver:
        return CubeDevice(Simulation(context.robot, context.options, context.clock))

    @hookimpl
    def robotd_axes(self, device: CubeDevice) -> SimAxes:
        return SimAxes(device.simulation)

    @hookimpl
    def robotd_io(self, device: CubeDevice) -> SimIo:
        return SimIo(device.simulation)

    @hookimpl
    def robotd_passive_joints(self, device: CubeDevice) -> PassiveJoints:
        return Fingers(device)

    @hookimpl
    def robotd_world(self, device: CubeDevice) -> World:
        return Cubes(device)


def make_node(robot: Any, host: Any) -> Any:
    """Return a node whose service answers from the device of its backend."""
    from rclpy.node import Node
    from std_srvs.srv import Trigger

    from robotd_ros.api import add_service

    device: CubeDevice = robot.device
    node = Node(NODE, context=host.context)
    add_service(node, host, Trigger, "~/where", lambda *_: f"x={device.cube[0]:g}")
    return node


def cube_backend() -> Backend:
    """Return the backend, loaded as a plugin."""
    return Backend(PluginOrigin("cubes", "tests.world_backend", "cubes", "1.0"), CubeBackend())
