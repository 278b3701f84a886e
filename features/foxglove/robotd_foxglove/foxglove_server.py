"""Server for the program Foxglove, on the loopback interface; needs foxglove-sdk."""

from __future__ import annotations

import json
import threading
from collections.abc import Mapping
from typing import Any, Self

import foxglove
from foxglove.channels import FrameTransformsChannel
from foxglove.messages import FrameTransform, FrameTransforms, Quaternion, Timestamp, Vector3
from foxglove.websocket import ChannelView, Client, ServerListener

from robotd.api import NANOSECONDS, FloatArray, OperationError, get_logger
from robotd.api.features import Tap, measured_joints
from robotd.api.models import JointFrames, UrdfJoint, parse_urdf
from robotd_foxglove.limited_port import LimitedPort
from robotd_messages.message_encoders import (
    JOINT_STATE,
    LOG,
    SCHEMAS,
    STRING,
    joint_state,
    log_message,
    string_message,
)
from robotd_shared.mesh_files import drawable_meshes
from robotd_shared.robot_state import SHARED_S, Goals, state_of

log = get_logger("foxglove")

ADDRESS = "127.0.0.1"
RATE_HZ = 30.0
DESCRIPTION = "/robot_description"
STATE_TICKS = 15  # of ``RATE_HZ``
END_TIMEOUT_S = 2.0
TEXT: Mapping[str, Any] = {"type": "string"}
NUMBER: Mapping[str, Any] = {"type": "number"}
COUNT: Mapping[str, Any] = {"type": "integer"}
FLAG: Mapping[str, Any] = {"type": "boolean"}


def _record(**fields: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "object", "properties": fields, "required": [*fields]}


def _list(items: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": items}


_PROBLEM = _record(
    kind=TEXT, is_fault=FLAG, text=TEXT, axes=_list(TEXT), code=COUNT, remedy=TEXT, since_s=NUMBER
)
_AXIS = _record(
    servo=FLAG,
    offline=FLAG,
    fault=TEXT,
    mode=TEXT,
    operation=TEXT,
    owner=TEXT,
    switches=_list(TEXT),
)
_GOAL = _record(duration_s=NUMBER, joints=_list(TEXT), sender=TEXT, ending=TEXT)
_NODE = _record(
    id=COUNT,
    state=TEXT,
    offline=FLAG,
    error_code=COUNT,
    axes=COUNT,
    inputs=COUNT,
    outputs=COUNT,
    fault=TEXT,
)
_BUS = _record(
    name=TEXT,
    state=TEXT,
    lost_frames=COUNT,
    timeouts=COUNT,
    late_cycles=COUNT,
    note=TEXT,
    details={"type": "object"},
    nodes=_list(_NODE),
)

STATE_SCHEMA = {
    "title": "robotd.State",
    **_record(
        type=TEXT,
        device=TEXT,
        ready=FLAG,
        problems=_list(_PROBLEM),
        speed=NUMBER,
        paused=FLAG,
        axes=_list(_AXIS),
        # null where a group of joints follows no goal.
        goals=_list({"oneOf": [_GOAL, {"type": "null"}]}),
        inputs=TEXT,
        outputs=TEXT,
        buses=_list(_BUS),
        missed=COUNT,
        viewers=COUNT,
    ),
}


class FoxgloveServer:
    """Server for Foxglove: ``with FoxgloveServer(...):``. Its thread is ``robotd-foxglove``.

    Clients reach it through a ``LimitedPort``, whose thread is ``robotd-foxglove-port``.

    Nothing is computed for a topic without subscribers. Clients can only read.

    Args:
        port: on the loopback interface; 0: any free one.

    Attributes:
        url: for the dialogue "Open connection".

    Raises OperationError: the port cannot be used.
    """

    def __init__(self, tap: Tap, port: int) -> None:
        self._tap, self._robot = tap, tap.robot
        meshes = drawable_meshes(tap.urdf, tap.robot.descriptor.urdf)

        def read_mesh(name: str) -> bytes | None:
            return meshes[name].read_bytes() if name in meshes else None

        self._context = context = foxglove.Context()  # its channels end with it
        self._joints = _ros_channel("/joint_states", JOINT_STATE, context)
        self._log = _ros_channel("/rosout", LOG, context)
        self._description = _ros_channel(DESCRIPTION, STRING, context)
        self._state = _json_channel("/robotd/state", STATE_SCHEMA, context)
        self._transforms = FrameTransformsChannel("/tf", context=context)
        gripper = tap.robot.gripper
        self._fingers = gripper.finger_ends if gripper is not None else {}
        self._encode = joint_state([*tap.robot.axes.names, *self._fingers], 3).encode
        self._frames = _frames(tap)
        self._cursor, self._events = 0, tap.events.since(0)[1]
        self._goals = Goals(tap.robot)
        self._undescribed = threading.Event()
        try:
            self._server = foxglove.start_server(
                name=tap.robot.descriptor.name,
                host=ADDRESS,
                port=0,
                context=context,
                asset_handler=read_mesh,
                server_listener=_Subscriptions(DESCRIPTION, self._undescribed),
            )
        except Exception as error:
            raise OperationError(f"foxglove: {error}") from error
        try:
            # foxglove-sdk takes any number of connections, and one that sends nothing for ever.
            self._port = LimitedPort(port, self._server.port)
        except OSError as error:
            self._server.stop()
            text = f"foxglove {port}: {error.strerror or error}; choose another port"
            raise OperationError(text) from error
        self.url = f"ws://{ADDRESS}:{self._port.number}"
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="robotd-foxglove", daemon=True)

    def __enter__(self) -> Self:
        self._port.start()
        self._thread.start()
        log.info("foxglove", url=self.url)
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join(END_TIMEOUT_S)
        self._port.stop()
        self._server.stop()

    def _run(self) -> None:
        tick = 0
        try:
            while not self._stop.wait(1.0 / RATE_HZ):
                self._robot.control_loop.yield_to_control_loop()
                self._send_values()
                self._send_events()
                if tick % STATE_TICKS == 0:
                    self._send_state()
                tick += 1
        except Exception:
            log.exception("the server for Foxglove has ended")

    def _send_values(self) -> None:
        if not (self._joints.has_sinks() or self._transforms.has_sinks()):
            self._cursor = self._tap.frames.written
            return
        frames, self._cursor, _ = self._tap.frames.since(self._cursor)
        newest = frames[-1:]
        if not newest["stamp_ns"].any():  # no new frame, or one without known values
            return
        stamps_ns = newest["stamp_ns"] + self._tap.offset_ns
        measured = measured_joints(newest, self._fingers)
        if self._joints.has_sinks():
            (message,) = self._encode(stamps_ns, *measured)
            self._joints.log(message, log_time=int(stamps_ns[0]))
        if self._frames is not None and self._transforms.has_sinks():
            position = measured[0][0]
            fingers = range(len(self._robot.axes.names), len(position))  # after the axes
            positions = position[[*self._robot.joint_axes, *fingers]]
            self._transforms.log(_transforms(self._frames, positions, int(stamps_ns[0])))

    def _send_events(self) -> None:
        events, self._events = self._tap.events.since(self._events)
        for event in events:
            self._goals.note(event)
            if self._log.has_sinks():
                time_ns = event.time_ns + self._tap.offset_ns
                self._log.log(log_message(event, time_ns), log_time=time_ns)

    def _send_state(self) -> None:
        if self._state.has_sinks():
            self._state.log(state_of(self._tap, self._goals.running(), 0, SHARED_S))
        if self._undescribed.is_set():
            self._undescribed.clear()
            self._description.log(string_message(self._tap.urdf))


class _Subscriptions(ServerListener):  # type: ignore[misc] # untyped
    """Sets ``subscribed`` for each client that subscribes to ``topic``. Threads of the server."""

    def __init__(self, topic: str, subscribed: threading.Event) -> None:
        self._topic, self._subscribed = topic, subscribed

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        if channel.topic == self._topic:
            self._subscribed.set()


def _ros_channel(topic: str, kind: str, context: foxglove.Context) -> foxglove.Channel:
    schema = foxglove.Schema(name=kind, encoding="ros2msg", data=SCHEMAS[kind].encode())
    return foxglove.Channel(topic, schema=schema, message_encoding="cdr", context=context)


def _json_channel(
    topic: str, schema: Mapping[str, Any], context: foxglove.Context
) -> foxglove.Channel:
    data = json.dumps(schema).encode()
    named = foxglove.Schema(name=schema["title"], encoding="jsonschema", data=data)
    return foxglove.Channel(topic, schema=named, message_encoding="json", context=context)


def _frames(tap: Tap) -> JointFrames | None:
    """Return the frames of the URDF; None without one."""
    path = tap.robot.descriptor.urdf
    if not tap.urdf or path is None:
        return None
    gripper = tap.robot.gripper
    fingers = gripper.joints if gripper is not None else ()
    return JointFrames(parse_urdf(tap.urdf, path), [*tap.robot.joint_names, *fingers])


def _transforms(frames: JointFrames, positions: FloatArray, time_ns: int) -> FrameTransforms:
    stamp = Timestamp(sec=time_ns // NANOSECONDS, nsec=time_ns % NANOSECONDS)
    moving = zip(frames.moving, frames.transforms(positions).tolist(), strict=True)
    still = zip(frames.still, frames.still_transforms().tolist(), strict=True)
    return FrameTransforms(
        transforms=[_transform(*pair, stamp=stamp) for pairs in (moving, still) for pair in pairs]
    )


def _transform(joint: UrdfJoint, numbers: list[float], *, stamp: Timestamp) -> FrameTransform:
    x, y, z, qx, qy, qz, qw = numbers
    return FrameTransform(
        timestamp=stamp,
        parent_frame_id=joint.parent,
        child_frame_id=joint.child,
        translation=Vector3(x=x, y=y, z=z),
        rotation=Quaternion(x=qx, y=qy, z=qz, w=qw),
    )
