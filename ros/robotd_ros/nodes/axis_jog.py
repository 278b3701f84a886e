"""Dead-man jog of single axes: they move while messages come."""

from __future__ import annotations

from typing import Any

from robotd.clock import NANOSECONDS
from robotd.control.joint_stream import JointCommands
from robotd.device.axes import Jog
from robotd.device.process_image import ProcessImage
from robotd.device.state import CommandMode
from robotd.errors import RobotdError
from robotd.log import get_logger
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.nodes import axis_conversions
from robotd_ros.nodes.axis_motion import NO_VELOCITY, AxisSources
from robotd_ros.nodes.topic_stream import TopicStream

log = get_logger("commands")

CHECK_HZ = 50.0


class AxisJog:
    """Jogs axes for ``timeout_s`` with each message.

    Joints in position mode are streamed, within the limits of the descriptor; axes in velocity
    mode get a velocity command, which ends with its own deceleration. ``take`` for the executor
    thread, ``check`` for the control loop.

    Args:
        host: its workers stop axes.
        topic: name, for the log.
        timeout_s: age of the last message at which an axis slows to rest.
    """

    def __init__(self, robot: Robot, host: RosHost, topic: str, timeout_s: float) -> None:
        self._robot, self._host = robot, host
        self._timeout_ns = round(timeout_s * NANOSECONDS)
        self._streams = [
            (group, TopicStream(group.stream.client(topic, timeout_s), host, topic))
            for group in robot.groups.values()
        ]
        self._sources = AxisSources(
            robot, topic, CommandMode.VELOCITY, NO_VELOCITY, timeout_s, any_mode=robot.joint_axes
        )
        self._deadlines: dict[int, int] = {}  # of axes in velocity mode
        rate_hz = min(CHECK_HZ, robot.descriptor.cycle.rate_hz)
        robot.control_loop.every(rate_hz, "axis jog", self.check)

    def take(self, message: Any, sent_ns: int) -> None:
        """Move as an AxisVelocity says that was sent at ``sent_ns``. Raises RobotdError."""
        jogs = axis_conversions.jogs(message)
        axes, image = self._robot.axes, self._robot.image
        self._sources.admit([(jog.axis, jog.profile.velocity != 0.0) for jog in jogs])
        axes.check_axes([jog.axis for jog in jogs])
        streamed = [jog for jog in jogs if self._is_streamed(jog.axis, image)]
        others = [jog for jog in jogs if jog not in streamed]
        if others:
            axes.jog(others)
            deadline_ns = sent_ns + self._timeout_ns
            self._deadlines |= dict.fromkeys((jog.axis for jog in others), deadline_ns)
        for group, stream in self._streams:
            if any(jog.axis in group.joint_axes for jog in streamed):
                velocity = [_velocity(axis, streamed) for axis in group.joint_axes]
                stream.apply(JointCommands.velocity, velocity, sent_ns)

    def check(self, image: ProcessImage) -> None:
        """Stop the axes whose messages have stopped."""
        if not self._deadlines:
            return
        now_ns = self._robot.clock.now_ns()
        late = [axis for axis, due_ns in tuple(self._deadlines.items()) if now_ns > due_ns]
        for axis in late:
            self._deadlines.pop(axis, None)
        if late:
            try:
                self._host.submit(self._robot.axes.stop, late, urgent=True)
            except RobotdError as error:
                for axis in late:  # the next check tries again; a new message sets a later time
                    self._deadlines.setdefault(axis, now_ns)
                log.error("a jog could not be stopped", axes=late, reason=str(error))

    def _is_streamed(self, axis: int, image: ProcessImage) -> bool:
        return axis in self._robot.joint_axes and image.mode[axis] == CommandMode.POSITION


def _velocity(axis: int, jogs: list[Jog]) -> float:
    return next((jog.profile.velocity for jog in jogs if jog.axis == axis), 0.0)
