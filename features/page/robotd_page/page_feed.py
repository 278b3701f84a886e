"""Messages to the viewers of a page, made from the tap of a robot in this process.

What the page draws is constant (robot, axes, limits, names, URDF), or moves (samples, objects).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from robotd.api import FloatArray, InvalidArgument, RobotdError
from robotd.api.features import MAX_IO_BYTES, CameraPictures, Tap, identity
from robotd.api.models import RobotDescriptor, transform_numbers
from robotd.api.robots import Gripper, PacedClock, Robot
from robotd_page.live_samples import LiveSamples
from robotd_page.page_message import Message, json_text
from robotd_page.seen_state import reduces_motion
from robotd_shared.mesh_files import MeshFiles
from robotd_shared.robot_state import SHARED_S, Goals, event_of, state_of

FIRST_EVENTS = 300  # of the log that a new viewer gets
STATE_LOOKS = 2  # calls of ``PageFeed.messages`` with changes for one state
REPEAT_LOOKS = 10  # for a state that has not changed: a page that hears nothing calls itself old
PROTOCOL = 2  # of the messages; the page asks to be loaded again when it has another one
DIGITS = 5  # of poses: 0.01 mm


def describe(
    tap: Tap,
    nodes: Sequence[str],
    meshes: Mapping[str, str],
    *,
    has_control: bool = False,
    namespace: str = "/",
) -> dict[str, Any]:
    """Return the first message to a viewer.

    Args:
        nodes: names of the ROS nodes that are served.
        meshes: URL of each mesh, by its name in the URDF.
        has_control: the page can be unlocked to control the robot.
    """
    robot = tap.robot
    descriptor, clock = robot.descriptor, robot.clock
    return {
        "type": "description",
        "protocol": PROTOCOL,
        **identity(robot, namespace),
        "time_scale": _finite(clock.scale) if isinstance(clock, PacedClock) else 1.0,
        "rate_hz": descriptor.cycle.rate_hz,
        "wall_offset_s": round(tap.offset_ns * 1e-9, 3),
        "axes": _axes(robot),
        "groups": [*robot.groups],
        "tools": [{"link": tool.link, "base": tool.base} for tool in robot.tools],
        "fingers": _fingers(robot.gripper),
        "inputs": min(robot.io.sizes[0], MAX_IO_BYTES),
        "outputs": min(robot.io.sizes[1], MAX_IO_BYTES),
        "io_names": _io_names(descriptor),
        "nodes": [*nodes],
        "urdf": tap.urdf,
        "meshes": dict(meshes),
        "urdf_file": str(descriptor.urdf.absolute()) if descriptor.urdf else "",
        "has_control": has_control,
    }


def _axes(robot: Robot) -> list[dict[str, Any]]:
    joints = dict(zip(robot.joint_axes, robot.descriptor.joints, strict=True))
    drive = robot.descriptor.drive
    wheels = dict(zip(drive.axes, drive.wheel_joints, strict=False)) if drive else {}
    group_of = {
        name: group for group, members in robot.groups.items() for name in members.joint_names
    }
    described = []
    for axis, (name, limits) in enumerate(zip(robot.axes.names, robot.axes.limits, strict=True)):
        joint = joints.get(axis)
        kind = "joint" if joint else "wheel" if axis in robot.servos.used else "axis"
        described.append(
            {
                "name": name,
                "kind": kind,
                "joint": name if joint else wheels.get(axis, ""),
                "group": group_of.get(name, "") if len(robot.groups) > 1 else "",
                "unit": limits.unit,
                "lower": _finite(limits.lower),
                "upper": _finite(limits.upper),
                "velocity": _finite(limits.velocity),
                "effort": joint.rated_effort if joint else None,
            }
        )
    return described


def _fingers(gripper: Gripper | None) -> list[dict[str, Any]]:
    """Return name and positions of each finger joint."""
    if gripper is None:
        return []
    return [
        {"name": name, "open": opened, "closed": closed}
        for name, (opened, closed) in gripper.finger_ends.items()
    ]


def _io_names(descriptor: RobotDescriptor) -> dict[str, str]:
    """Return names by address: ``out0.3`` is bit 3 of output byte 0."""
    names: dict[str, str] = {}
    if gripper := descriptor.gripper:
        names[f"out{gripper.output_byte}.{gripper.output_bit}"] = "close gripper"
        if sensor := gripper.part_sensor:
            names[f"in{sensor.input_byte}.{sensor.input_bit}"] = "part in gripper"
    if stop := descriptor.stop_input:
        names[f"in{stop.input_byte}.{stop.input_bit}"] = "stop input"
    names |= {f"in{at.byte}.{at.bit}": name for name, at in descriptor.inputs.items()}
    names |= {f"out{at.byte}.{at.bit}": name for name, at in descriptor.outputs.items()}
    return names


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


class WorldObjects:
    """Shapes and poses of the objects of a robot's world, which may have none. One thread.

    Where the backend fails to return the poses, the last ones stay; the tap logs the error.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot, self._world = robot, robot.world
        self._shown: FloatArray = np.empty(0)

    def describe(self) -> dict[str, Any] | None:
        """Return the frame, and shape and pose of each object; None without objects."""
        world = self._world
        if world is None or not len(poses := self._poses()):
            return None
        shapes = [
            {"name": item.name, "shape": item.shape, "size": item.size_m, "color": item.color}
            for item in world.objects
        ]
        return {"frame": world.frame, "shapes": shapes, "poses": poses.tolist()}

    def moved(self) -> Message | None:
        """Return the poses where they differ from those of the call before."""
        if self._world is None or not self._robot.connection.ready:
            return None
        poses = self._poses()
        if np.array_equal(poses, self._shown):
            return None
        self._shown = poses
        return json_text({"type": "objects", "poses": poses.tolist()})

    def _poses(self) -> FloatArray:
        """Return the rounded poses (n, 7), m and quaternions x, y, z, w."""
        if self._world is None:
            return np.empty(0)
        try:
            return self._world.poses().round(DIGITS)
        except RobotdError:
            return self._shown


class GuardedSolids:
    """Bodies that the arms of a robot keep away from, in each link. One thread."""

    def __init__(self, robot: Robot) -> None:
        self._limits = [group.motion_limits for group in robot.groups.values()]
        self._shown = [limits.solids for limits in self._limits]

    def describe(self) -> list[dict[str, Any]]:
        """Return shape and place of each solid."""
        return [
            {
                "name": solid.name,
                "shape": solid.shape,
                "size": solid.size_m,
                "pose": transform_numbers(solid.pose).round(DIGITS).tolist(),
                "frame": solid.link,
            }
            for limits in self._limits
            for solid in limits.solids
        ]

    def changed(self) -> Message | None:
        """Return all solids where they differ from those of the call before."""
        solids = [limits.solids for limits in self._limits]
        if all(one is other for one, other in zip(solids, self._shown, strict=True)):
            return None
        self._shown = solids
        return json_text({"type": "scene", "solids": self.describe()})


class PageFeed:
    """Makes each message once for all viewers. One thread; nothing runs between the calls.

    Args:
        nodes: names of the ROS nodes that are served.
        meshes: URL of each mesh, by its name in the URDF.
        has_control: the page can be unlocked to control the robot.
        has_pictures: the server has pictures of the cameras.
    """

    def __init__(
        self,
        tap: Tap,
        nodes: Sequence[str],
        meshes: Mapping[str, str],
        *,
        has_control: bool = False,
        namespace: str = "/",
        has_pictures: bool = False,
    ) -> None:
        self._tap, self._has_pictures = tap, has_pictures
        self._describe = partial(
            describe, tap, nodes, meshes, has_control=has_control, namespace=namespace
        )
        self._live = LiveSamples(tap)
        self._objects, self._solids = WorldObjects(tap.robot), GuardedSolids(tap.robot)
        _ = tap.robot.backend.code_tables  # imported now, not at the first alarm
        self._goals = Goals(tap.robot)
        self._cursor = self._looks = 0
        self._seen = 0  # number of the newest event that reduces motion
        self._state: dict[str, Any] = {}

    def first(self, viewers: int) -> list[Message]:
        """Return the messages to a new viewer: description, past, state, events.

        Args:
            viewers: number of viewers, with the new one.
        """
        if viewers == 1:
            self._live.restart()
            self._note(*self._tap.events.since(self._cursor))
        description = self._describe()
        description["objects"] = self._objects.describe()
        description["solids"] = self._solids.describe()
        description["cameras"] = self._cameras() if self._has_pictures else []
        held, added = self._tap.events.since(0)
        sent = max(0, len(held) - (added - self._cursor))  # the others come with the changes
        events = held[:sent][-FIRST_EVENTS:]
        return [
            json_text(description),
            self._live.history(),
            json_text(self._read_state(viewers)),
            json_text({"type": "events", "events": [*map(event_of, events)]}),
        ]

    def messages(self, viewers: int, *, changes: bool) -> Iterator[Message]:
        """Yield the newest sample, objects that moved, and events and state where they are due."""
        if sample := self._live.sample():
            yield sample
        if moved := self._objects.moved():
            yield moved
        if solids := self._solids.changed():
            yield solids
        if changes:
            yield from self._changes(viewers)

    def _changes(self, viewers: int) -> Iterator[Message]:
        """Yield new events, and the state where it is due.

        The state is read with each event and else in every ``STATE_LOOKS``-th call, because it
        takes ten times as long as a sample. It is sent with each change, and once a second.
        """
        events, cursor = self._tap.events.since(self._cursor)
        self._note(events, cursor)
        if events:
            yield json_text({"type": "events", "events": [*map(event_of, events[-FIRST_EVENTS:])]})
        self._looks += 1
        if not events and self._looks % STATE_LOOKS:
            return
        # With an event problems are new: what a viewer has seen decides which commands are taken.
        state = self._read_state(viewers, 0.0 if events else SHARED_S)
        if state != self._state or self._looks % REPEAT_LOOKS == 0:
            self._state = state
            yield json_text(state)

    def _cameras(self) -> list[dict[str, Any]]:
        world = self._tap.robot.world
        names = ("name", "width", "height", "rate_hz")
        return (
            [{key: getattr(camera, key) for key in names} for camera in world.cameras]
            if world
            else []
        )

    def _note(self, events: Sequence[Any], cursor: int) -> None:
        self._cursor = cursor
        for number, event in enumerate(events, cursor - len(events) + 1):
            self._goals.note(event)
            if reduces_motion(event):
                self._seen = number

    def _read_state(self, viewers: int, max_age_s: float = 0.0) -> dict[str, Any]:
        state = state_of(self._tap, self._goals.running(), viewers, max_age_s)
        return {**state, "seen": self._seen}  # commands of a page return it


class RobotSource:
    """The robot of this process: its feed, its meshes and the pictures of its cameras.

    Args:
        nodes: names of the ROS nodes that are served.
        has_control: the page can be unlocked to control the robot.
    """

    def __init__(
        self,
        tap: Tap,
        nodes: Sequence[str],
        *,
        has_control: bool = False,
        namespace: str = "/",
    ) -> None:
        self._meshes = MeshFiles()
        urls = self._meshes.add(tap.urdf, tap.robot.descriptor.urdf)
        self.feed = PageFeed(
            tap, nodes, urls, has_control=has_control, namespace=namespace, has_pictures=True
        )
        world = tap.robot.world
        self._pictures = CameraPictures(world) if world is not None else None
        self._loop = tap.robot.control_loop

    def file(self, url: str) -> Path | None:
        return self._meshes.file(url)

    def picture(self, camera: str) -> bytes:
        """Return the newest picture as JPEG. Blocks; any thread.

        Raises InvalidArgument for an unknown camera, OperationError without OpenGL or Pillow.
        """
        if self._pictures is None:
            raise InvalidArgument("the robot has no cameras")
        return self._pictures.newest(camera)

    @property
    def yield_to_control_loop(self) -> Callable[[], None]:
        return self._loop.yield_to_control_loop
