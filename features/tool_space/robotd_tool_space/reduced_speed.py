"""Reduced speed: a limit of the speed of links and tools. No safety function."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial

import numpy as np

from robotd.api import DescriptorError, FloatArray, Unsupported, get_logger, unknown_name
from robotd.api.features import EventKind, ProcessImage
from robotd.api.robots import Robot
from robotd_tool_space.robot_tool import RobotTool
from robotd_tool_space.settings import ToolSpaceKeys
from robotd_tool_space.tool_groups import ToolGroups

log = get_logger("tool")

PLANNED_SHARE = 0.98  # of the limit; the rest is for what happens within a period
STOP_SHARE = 1.1  # share of the limit from which a move or jog that runs in the device is stopped
MIN_SPEED_M_S = 1e-9  # slower counts as standing


class ReducedSpeed:
    """Switch that limits the speed of the tools of a robot. Any worker thread.

    The limit is that of the origins of all moving links of the chain, of the link of the tool, and
    of the tool, in the base of the arm. It is on by command, or by the input of the robot's file.

    Raises:
        DescriptorError: no input has that name.
        Unsupported, DescriptorError: no group has a usable chain, as ``ToolGroups``; or there is
            an input, and a group has none, or the device interpolates trajectories itself.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._tools: ToolGroups = robot.attribute("tool_groups")
        self._settings = settings = robot.descriptor.settings(ToolSpaceKeys).tool_space
        self._limit_m_s = settings.reduced_speed_m_s
        self._commanded = self._by_input = self._is_on = False
        self._listeners: list[Callable[[bool], None]] = []
        self._lock = threading.Lock()
        self._reads_input: Callable[[], bool] | None = None
        self._watches = False
        if (name := settings.reduced_speed_input) is not None:
            self._require_possible()
            address = robot.io.inputs.get(name)
            if address is None:
                text = unknown_name("input", name, robot.io.inputs)
                raise DescriptorError(text, key="tool_space.reduced_speed_input")
            self._reads_input = robot.io.input_watcher(*address)
            self._by_input = True  # until it has been read
            self._apply()
            self._watch()

    @property
    def is_on(self) -> bool:
        """The limit is in force."""
        return self._is_on

    @property
    def text(self) -> str:
        """State in words."""
        if not self._is_on:
            return "reduced speed is off"
        return f"reduced speed: links and tool move with at most {self._limit_m_s:g} m/s"

    def set(self, on: bool) -> None:
        """Switch it on or off by command; the input may keep it on.

        Motion slows down within the limits of the joints; moves and jogs of single axes that are
        faster are stopped, torque streams end.

        Raises Unsupported, DescriptorError: it cannot be on; see the class.
        """
        if on:
            self._require_possible()
        with self._lock:
            self._commanded = on
            self._apply()
            if on:
                self._watch()

    def on_change(self, listener: Callable[[bool], None]) -> None:
        """Call ``listener(on)`` now and on every change, from the thread that causes it."""
        with self._lock:
            self._listeners.append(listener)
            listener(self._is_on)

    def _watch(self) -> None:
        """Look in each period from now on; a robot that never needs it pays nothing."""
        if not self._watches:
            self._watches = True
            rate_hz = self._robot.descriptor.cycle.rate_hz
            self._robot.control_loop.every(rate_hz, "reduced speed", self._look)

    def _require_possible(self) -> None:
        if self._robot.axes.trajectories_on_device:
            raise Unsupported("reduced speed", self._robot.backend.name)
        for name, group in self._robot.groups.items():
            if group.joint_names:
                self._tools.of(name)

    def _apply(self) -> None:
        """Set or clear the limits. Lock held."""
        before, self._is_on = self._is_on, self._commanded or self._by_input
        remedy = "For full speed: robotd tool reduced off"
        if self._by_input:
            remedy = f"The input {self._settings.reduced_speed_input} switches it on"
        for tool in self._tools.values():
            limit = tool.group.motion_limits
            if self._is_on:
                limit.set_speed(partial(_factors, tool, self._limit_m_s), self.text, remedy)
            else:
                limit.clear_speed()
        if self._is_on != before:
            log.info(self.text)
            self._robot.events.add(EventKind.STATE, "speed", self.text)
            for listener in self._listeners:
                listener(self._is_on)

    def _look(self, image: ProcessImage) -> None:
        """Follow the input, and stop moves and jogs that are too fast. Control loop."""
        if self._reads_input is not None:
            by_input = self._reads_input() == bool(self._settings.reduced_speed_level)
            if by_input != self._by_input and self._lock.acquire(blocking=False):
                try:
                    self._by_input = by_input
                    self._apply()
                finally:
                    self._lock.release()
        if self._is_on:
            for tool in self._tools.values():
                self._stop_too_fast(tool, image)

    def _stop_too_fast(self, tool: RobotTool, image: ProcessImage) -> None:
        moved, factors = tool.moved_by_device(image), tool.group.motion_limits.factors
        if moved and factors is not None:
            axes = list(tool.group.joint_axes)
            velocity = np.where(np.isin(axes, moved), image.velocity[axes], 0.0)
            if float(factors(image.position[axes][None], velocity[None])[0]) < 1.0 / STOP_SHARE:
                self._robot.axes.stops.request(moved)


def _factors(
    tool: RobotTool, limit_m_s: float, positions: FloatArray, velocities: FloatArray
) -> FloatArray:
    """Return as ``Factors`` of ``MotionLimits``; where nothing moves it is huge."""
    points = np.stack([each.chain.end[:3, 3] for each in (tool.at_link, tool.kinematics)])
    speeds = tool.at_link.chain.speeds(positions, velocities, points).max(axis=-1)
    return PLANNED_SHARE * limit_m_s / np.maximum(speeds, MIN_SPEED_M_S)
