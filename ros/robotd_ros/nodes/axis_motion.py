"""Motion of single axes on topics: velocities, positions and distances."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

from robotd.control.rearming import CommandSource
from robotd.device.axes import Move
from robotd.device.state import CommandMode
from robotd.robot import Robot
from robotd_ros.nodes import axis_conversions

VELOCITY = "wmx/axis/velocity"
POSITION = "wmx/axis/position"
RELATIVE = "wmx/axis/position/relative"
NO_VELOCITY = "a velocity of 0"


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
