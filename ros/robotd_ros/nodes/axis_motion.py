"""Motion of single axes on topics: velocities, positions and distances."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from robotd.clock import NANOSECONDS
from robotd.control.groups.joint_stream import JointCommands
from robotd.control.loop.rearming import CommandSource
from robotd.device.axes import Jog, Move
from robotd.device.process_image import ProcessImage
from robotd.device.state import CommandMode
from robotd.errors import RobotdError
from robotd.log import get_logger
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.nodes import axis_conversions
from robotd_ros.nodes.topic_stream import TopicStream

VELOCITY = "wmx/axis/velocity"
POSITION = "wmx/axis/position"
RELATIVE = "wmx/axis/position/relative"
NO_VELOCITY = "a velocity of 0"
log = get_logger("commands")

CHECK_HZ = 50.0


class AxisSources:
    """Sources of the commands of a topic, one for each axis. Executor thread.

    Args:
        mode: of an axis in which its commands can move it.
        neutral: a command that asks for no motion, in words.
        timeout_s: age of the last message at which its motion ends; 0: it goes on.
        any_mode: axes that they can move in any mode.
    """

    def __init__(
        self,
        robot: Robot,
        topic: str,
        mode: CommandMode,
        neutral: str,
        timeout_s: float = 0.0,
        any_mode: Collection[int] = (),
    ) -> None:
        self._axes = robot.axes
        self._sources = [
            CommandSource(
                robot.rearming,
                f"{topic} ({name})",
                [axis],
                [] if axis in any_mode else [mode],
                timeout_s=timeout_s,
                neutral=neutral,
            )
            for axis, name in enumerate(robot.axes.names)
        ]

    def admit(self, commands: Sequence[tuple[int, bool]]) -> None:
        """Admit axes, each with True where its command asks for motion; raises RobotdError."""
        self._axes.check_numbers([axis for axis, _ in commands])
        for axis, moves in commands:
            self._sources[axis].admit(moves=moves)


class AxisMotion:
    """Executes messages that move single axes, or raises RobotdError. Executor thread.

    No motion of theirs ends with the age of a message, so ``sent_ns`` is not used.
    """

    def __init__(self, robot: Robot) -> None:
        self._axes, self._settings = robot.axes, robot.descriptor.trajectory
        position = CommandMode.POSITION
        self._velocities = AxisSources(robot, VELOCITY, CommandMode.VELOCITY, NO_VELOCITY)
        self._positions = AxisSources(robot, POSITION, position, "the present position")
        self._distances = AxisSources(robot, RELATIVE, position, "a distance of 0")

    def jog(self, message: Any, sent_ns: int) -> None:
        """Start or change the velocities of an AxisVelocity."""
        jogs = axis_conversions.jogs(message)
        self._velocities.admit([(jog.axis, jog.profile.velocity != 0.0) for jog in jogs])
        self._axes.jog(jogs)

    def move(self, message: Any, sent_ns: int) -> None:
        """Start the moves of an AxisPose."""
        moves = axis_conversions.moves(message)
        self._axes.check_numbers([move.axis for move in moves])
        self._positions.admit([(move.axis, self._is_elsewhere(move)) for move in moves])
        self._axes.move(moves)

    def move_relative(self, message: Any, sent_ns: int) -> None:
        """Start the moves of an AxisPose by distances."""
        moves = axis_conversions.moves(message)
        self._distances.admit([(move.axis, move.target != 0.0) for move in moves])
        self._axes.move(moves, relative=True)

    def _is_elsewhere(self, move: Move) -> bool:
        """Return True for a target that is not the present position."""
        settings, unit = self._settings, self._axes.limits[move.axis].unit
        tolerance = settings.start_tolerance_m if unit == "m" else settings.start_tolerance_rad
        present = float(self._axes.image.position_command[move.axis])
        return not abs(move.target - present) <= tolerance


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
        if any(jog.profile.velocity for jog in jogs):
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
            with self._tried_again(late):
                self._host.submit(self._stop, late, urgent=True)

    def _stop(self, late: Sequence[int]) -> None:
        """Worker: stop axes."""
        with self._tried_again(late):
            self._robot.axes.stop(late)

    @contextmanager
    def _tried_again(self, late: Sequence[int]) -> Iterator[None]:
        """Log an error of the block; the next check stops the axes again."""
        try:
            yield
        except RobotdError as error:
            now_ns = self._robot.clock.now_ns()
            for axis in late:  # a new message sets a later time
                self._deadlines.setdefault(axis, now_ns)
            log.error("a jog could not be stopped", axes=late, reason=str(error))

    def _is_streamed(self, axis: int, image: ProcessImage) -> bool:
        return axis in self._robot.joint_axes and image.mode[axis] == CommandMode.POSITION


def _velocity(axis: int, jogs: list[Jog]) -> float:
    return next((jog.profile.velocity for jog in jogs if jog.axis == axis), 0.0)
