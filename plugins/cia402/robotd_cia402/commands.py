"""All commands on one axis; here its command mode and its streams."""

from __future__ import annotations

import math
from typing import Any

from robotd.api import Clock, CommandMode, NotReady, Operation, Profile, RobotdError
from robotd_cia402.axis import Axis
from robotd_cia402.modes import STREAM_MODES, OperationMode, rest_mode
from robotd_cia402.motion_commands import MotionCommands
from robotd_cia402.object_numbers import TARGET_TORQUE
from robotd_cia402.power_commands import PowerCommands


class Commands(PowerCommands, MotionCommands):
    """Commands on one axis."""

    def __init__(self, axis: Axis[Any], clock: Clock) -> None:
        super().__init__(axis, clock)
        self._stops = 0  # when the stream was prepared

    def set_mode(self, mode: CommandMode) -> None:
        axis = self._axis
        with axis.lock:
            self.require_online()  # a lost drive may receive, and its position is not known
            self._require_not_guided()
            requested = rest_mode(axis.options, mode)
            if axis.report.powered:
                self._recover()
                self._enter(requested)
            else:
                axis.mode.requested = requested
            axis.mode.command_mode = mode

    def prepare_stream(self) -> None:
        """Enter the mode of the stream, with the command at the present position."""
        axis = self._axis
        self._stops = axis.activity.stops
        with axis.lock:
            self._require_power()
            if axis.activity.streaming:
                return
            self._recover()
            if axis.mode.command_mode is CommandMode.TORQUE:
                self._enter_torque()
                return
            if axis.mode.command_mode is CommandMode.VELOCITY:
                ramp = axis.options.stop_deceleration_rad_s2
                self._write_ramps(Profile(0.0, ramp, ramp))
                self._enter(self._rest_mode())
            else:
                self._enter(STREAM_MODES[axis.options.stream_mode])
            axis.setpoint.velocity = 0.0

    def begin_stream(self) -> None:
        """Follow the setpoints of the control loop; after ``prepare_stream``.

        Raises OperationError, with the axis stopped, after a stop since then.
        """
        axis = self._axis
        with axis.lock:
            axis.activity.complete = False
            axis.activity.begin(Operation.STREAM)
            self._require_no_stop(self._stops)

    def prepare_guiding(self) -> None:
        """Require an idle axis with power; end a quick stop."""
        axis = self._axis
        self._stops = axis.activity.stops
        with axis.lock:
            self._require_power()
            self._recover()
            if not axis.activity.is_idle:
                raise self._error(NotReady, f"it is in {axis.activity.operation.name.lower()}")

    def begin_guiding(self) -> None:
        """Let the control loop carry the axis; after ``prepare_guiding``.

        Raises OperationError, with the axis stopped, after a stop since then.
        """
        axis = self._axis
        with axis.lock:
            self._require_power()
            self._require_no_stop(self._stops)
            self._enter_torque()
            axis.setpoint.deceleration = axis.options.stop_deceleration_rad_s2
            axis.activity.complete = False
            axis.activity.begin(Operation.GUIDING)
            self._require_no_stop(self._stops)

    def leave_torque(self, operation: Operation = Operation.STREAM) -> None:
        """Stop an axis that is in cyclic torque mode, as out of ``operation``."""
        axis = self._axis
        with axis.lock:
            if axis.mode.requested.is_torque:
                axis.activity.begin(operation)
                axis.brake(axis.options.stop_deceleration_rad_s2)

    def end_stream(self) -> None:
        """Hold the last setpoint; still moving there, brake."""
        axis = self._axis
        with axis.lock:
            if not axis.activity.streaming:
                return
            if axis.mode.requested.is_torque or abs(axis.setpoint.velocity) > 1e-3:
                axis.brake(axis.options.stop_deceleration_rad_s2)
                return
            axis.hold()
            axis.activity.complete = True

    def _enter_torque(self) -> None:
        """Enter the cyclic torque mode, with the torque that holds the axis."""
        axis = self._axis
        if TARGET_TORQUE not in axis.drive.outputs:
            raise self._error(NotReady, "no PDO holds 0x6071 (target torque)")
        if not axis.drive.maps_mode:  # until the first torque it would have no position control
            raise self._error(NotReady, "its mode is changed by SDO, and torque needs it in PDOs")
        if not math.isfinite(axis.scaling.rated_torque_nm):
            raise self._error(NotReady, "the rated torque of the joint is not known")
        if not math.isfinite(axis.report.torque):
            raise self._error(NotReady, "no PDO holds 0x6077 (measured torque)")
        axis.setpoint.torque = axis.report.torque
        try:
            self._enter(OperationMode.CYCLIC_TORQUE)
        except RobotdError:
            axis.mode.requested = self._rest_mode()
            raise
