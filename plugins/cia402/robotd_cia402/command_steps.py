"""Steps that the commands on one axis have in common: requirements, waits, changes of mode."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from robotd.api import NANOSECONDS, Clock, DeviceTimeout, NotReady, RobotdError, wait_until
from robotd_cia402.axis import Axis
from robotd_cia402.controlword import Control, DriveState
from robotd_cia402.modes import TORQUE_MODES, OperationMode, mode_text, rest_mode
from robotd_cia402.object_numbers import MODE, MODE_DISPLAY

STEP_TIMEOUT_S = 1.0  # for a change of mode or a handshake
_FRESH_FRAMES = 5  # and a turn, after which every value is from after the event
_REST_VELOCITY = 0.01  # rad/s or m/s, of an axis whose mode is changed by SDO


class CommandSteps:
    """Base of the commands on one axis, one at a time. Worker threads.

    A wait that fails raises an error that names node and state.
    """

    def __init__(self, axis: Axis[Any], clock: Clock) -> None:
        self._axis, self._report, self._clock = axis, axis.report, clock

    def require_online(self) -> None:
        node = self._axis.drive.node
        if not node.online:
            raise self._error(NotReady, node.fault or "offline")

    def _require_power(self) -> None:
        self.require_online()
        self._require_not_guided()
        self._require_no_alarm()
        if not self._report.powered:
            lost = f": {self._axis.power.lost}" if self._axis.power.lost else ""
            raise self._error(NotReady, f"the servo is off{lost}")
        limit_s = self._axis.options.brake_release_s + STEP_TIMEOUT_S
        self._require(lambda: not self._axis.holding_brake.holds, limit_s, "its brake holds")

    def _require_not_guided(self) -> None:
        if self._axis.activity.guided:
            raise self._error(NotReady, "it is guided by hand")

    def _require_mode(self, timeout_s: float) -> None:
        """Wait for a drive that has left the commanded mode; raise DeviceTimeout if it stays so."""
        mode = self._axis.mode
        lost = mode.lost
        if not self._wait(lambda: not mode.lost, timeout_s):
            raise self._error(DeviceTimeout, f"{lost}; switch the servo off and on")

    def _require_no_alarm(self) -> None:
        if self._report.in_alarm:
            self._report.read_error_register()
            raise self._error(NotReady, f"the drive is in alarm: {self._report.alarm_text}")

    def _rest_mode(self) -> OperationMode:
        """Mode of an axis without a command."""
        return rest_mode(self._axis.options, self._axis.mode.command_mode)

    def _enter(self, mode: OperationMode) -> None:
        """Change the mode of a powered axis at rest; wait for the mode display."""
        axis, report = self._axis, self._report
        if report.displayed_mode != mode or axis.mode.requested is not mode:
            if report.powered and not axis.drive.maps_mode:
                self._require_rest()
            if not axis.mode.requested.is_cyclic_position:
                axis.setpoint.position = axis.present_position()
            axis.setpoint.velocity = 0.0
            axis.mode.requested = mode
        self._change_by_sdo(mode)
        if not self._wait(lambda: report.displayed_mode == mode, STEP_TIMEOUT_S):
            shown = f"the drive shows mode {report.displayed_mode} after {STEP_TIMEOUT_S:g} s"
            text = f"mode {mode.name.lower()} was requested, {shown}"
            raise self._error(DeviceTimeout, text)
        if mode.is_cyclic_position:
            axis.mode.bits = 0

    def _change_by_sdo(self, mode: OperationMode) -> None:
        """Change the mode of a drive whose cyclic frames do not hold it, and read it back.

        ``mode`` is requested: the frames have its setpoints. The drive is in an unknown mode until
        it displays the new one, so it has to be at rest. In that mode already, it stays as it is.
        Raises NotReady in motion, DeviceTimeout, and the errors of SDO.
        """
        axis, drive, report = self._axis, self._axis.drive, self._report
        if drive.maps_mode or (drive.shown_mode == mode == drive.read(MODE_DISPLAY)):
            return
        powered = report.powered
        if powered:
            self._require_rest()
        had_target = drive.shown_mode == OperationMode.PROFILE_POSITION
        axis.mode.forget()
        drive.note_mode(OperationMode.NONE)
        if mode.is_cyclic_position:  # elsewhere than in a position mode its demand may be old
            axis.setpoint.stand_at(report.demand() if had_target else report.position)
        # Setpoints of the mode before may be elsewhere: the drive has the new ones first.
        if not self._wait_for_fresh_values():
            raise self._error(
                DeviceTimeout, f"it does not answer the setpoints of {mode_text(mode)}"
            )
        if MODE not in drive.outputs:
            drive.write(MODE, 0, mode)
        wait_until(lambda: drive.read(MODE_DISPLAY) == mode, STEP_TIMEOUT_S, self._clock)
        shown = drive.read(MODE_DISPLAY)
        if powered and shown != mode:  # else it may change when it is on
            text = f"{mode_text(mode)} was written, the drive shows {mode_text(shown)}"
            raise self._error(DeviceTimeout, f"{text} after {STEP_TIMEOUT_S:g} s")
        drive.note_mode(shown)

    def _require_rest(self) -> None:
        """Require an idle axis whose motor is at rest. Raises NotReady, DeviceTimeout."""
        axis, report = self._axis, self._report
        if not axis.activity.is_idle:
            raise self._error(NotReady, "it moves, and its mode is changed by SDO, at rest only")
        slow = lambda: abs(report.velocity) < _REST_VELOCITY  # noqa: E731
        self._require(slow, STEP_TIMEOUT_S, "it moves, and its mode is changed at rest only")

    def _wait_for_fresh_values(self) -> bool:
        """Wait until every value is from after the present frame; False: the drive is silent."""
        drive = self._axis.drive
        sent, answered = drive.frames + _FRESH_FRAMES + drive.turn, drive.answered + _FRESH_FRAMES
        return self._wait(
            lambda: drive.frames >= sent and drive.answered >= answered,
            STEP_TIMEOUT_S + drive.turn * self._report.period_s,
        )

    def _recover(self) -> None:
        """Leave a quick stop (transition 16), with the command at the present position.

        A drive that was stopped in the cyclic torque mode gets a position mode first: operation is
        never enabled with a torque.

        Raises DeviceTimeout when it does not come to rest, or does not obey.
        """
        axis, report = self._axis, self._report
        if report.state is not DriveState.QUICK_STOP_ACTIVE:
            return
        braking_s = abs(report.velocity) / axis.options.quick_stop_deceleration_rad_s2
        late = "it still moves in its quick stop"
        self._require(lambda: axis.activity.is_idle, braking_s + STEP_TIMEOUT_S, late)
        axis.setpoint.stand_at(axis.present_position())
        if axis.mode.requested.is_torque:
            axis.mode.requested = self._rest_mode()
        if not self._wait(lambda: report.displayed_mode not in TORQUE_MODES, STEP_TIMEOUT_S):
            text = "the drive remains in its torque mode; switch the servo off and on"
            raise self._error(DeviceTimeout, text)
        self._require_mode(STEP_TIMEOUT_S)
        if axis.mode.requested is OperationMode.PROFILE_POSITION:
            axis.mode.bits |= Control.HALT
        axis.power.leave_quick_stop()
        late = "the drive remains in quick stop"
        self._require(lambda: report.state is DriveState.OPERATION_ENABLED, STEP_TIMEOUT_S, late)

    def _require(self, condition: Callable[[], bool], timeout_s: float, late: str) -> None:
        """Wait for ``condition``; raise DeviceTimeout with ``late`` and the state otherwise."""
        if not self._wait(condition, timeout_s):
            raise self._error(DeviceTimeout, f"{late}, {self._status()}")

    def _countdown(self, timeout_s: float) -> Callable[[], float]:
        """Return a function that returns the seconds left from now on, at least 0."""
        deadline_ns = self._clock.now_ns() + round(timeout_s * NANOSECONDS)
        return lambda: max(0.0, (deadline_ns - self._clock.now_ns()) / NANOSECONDS)

    def _wait(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Wait for ``condition``; False at once when the node is lost."""
        node = self._axis.drive.node
        met = wait_until(lambda: condition() or not node.online, timeout_s, self._clock)
        return met and node.online and condition()

    def _error(self, kind: type[RobotdError], text: str) -> RobotdError:
        """Return an error of this axis that names its node, or why that is lost."""
        node = self._axis.drive.node
        if kind is DeviceTimeout and not node.online:
            kind, text = NotReady, node.fault or "offline"
        return kind(f"{node.label}: {text}", axis=self._axis.number)

    def _status(self) -> str:
        report, node = self._report, self._axis.drive.node
        if not node.online:
            return str(node.fault)
        return f"statusword 0x{report.statusword:04X} ({report.state.value})"
