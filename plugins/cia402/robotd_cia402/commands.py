"""Multi-step commands on one axis: servo, mode, stream, move, jog, homing."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from robotd.api import (
    NANOSECONDS,
    Clock,
    CommandMode,
    DeviceTimeout,
    InvalidArgument,
    NotReady,
    Operation,
    OperationError,
    Profile,
    RobotdError,
    wait_until,
)
from robotd_cia402.axis import Axis
from robotd_cia402.controlword import TOWARDS_ENABLED, Control, DriveState, Status
from robotd_cia402.modes import STREAM_MODES, VELOCITY_MODES, OperationMode, rest_mode
from robotd_cia402.object_numbers import TARGET_TORQUE, TARGET_VELOCITY

_HERE = (35, 37)  # homing methods that take the present position
_STEP_S = 1.0  # for a change of mode or a handshake
_FRESH_FRAMES = 5  # and a turn, after which every value is from after the event


class Commands:
    """Commands on one axis, one at a time. Worker threads.

    A wait that fails raises an error that names node and state.
    """

    def __init__(self, axis: Axis[Any], clock: Clock) -> None:
        self._axis, self._report, self._clock = axis, axis.report, clock
        self._stops = 0  # when the stream was prepared

    def enable(self, timeout_s: float) -> None:
        """Enable operation, with the command at the measured position.

        An axis that is on is left as it is, and taken out of a quick stop. Nothing is switched on
        after ``timeout_s``, or after a ``disable`` that came meanwhile.
        """
        axis, report, releases = self._axis, self._report, self._axis.power.releases
        left_s = self._countdown(timeout_s)

        def step(control: Control, *, done: bool = False) -> None:
            if not axis.power.switch_on(control, releases, done=done):
                raise self._error(OperationError, "switched off before the servo was on")

        with axis.lock:
            self.require_online()
            if axis.power.requested and report.powered:
                self._recover()
                return
            if not self._wait(lambda: report.known, left_s()):
                reason = axis.drive.node.fault or axis.drive.awaited
                raise self._error(NotReady, f"its position is not known: {reason}")
            late = f"the last servo-off has not ended within {timeout_s:g} s"
            self._require(lambda: not report.powered, left_s(), late)
            axis.mode.bits = 0
            axis.power.lost = ""
            axis.mode.requested = self._rest_mode()
            # Without a torque an arm would fall. Some drives change their mode when they are on.
            torque = OperationMode.CYCLIC_TORQUE
            self._wait(lambda: report.displayed_mode != torque, min(_STEP_S, left_s() / 2))
            try:
                while (state := report.state) is not DriveState.OPERATION_ENABLED:
                    self._require_no_alarm()
                    step(TOWARDS_ENABLED.get(state, Control.DISABLE_VOLTAGE))
                    left = partial(self._has_left, state, releases)
                    if not left_s() or not self._wait(left, left_s()):
                        text = f"the servo did not go on within {timeout_s:g} s, {self._status()}"
                        raise self._error(DeviceTimeout, text)
                self._enter(axis.mode.requested)
                step(Control.ENABLE_OPERATION, done=True)
            except RobotdError:
                axis.power.control = int(Control.DISABLE_VOLTAGE)
                raise

    def _has_left(self, state: DriveState, releases: int) -> bool:
        return self._report.state is not state or self._axis.power.releases != releases

    def disable(self, timeout_s: float) -> None:
        """Switch the power stage off at once, whatever another command waits for.

        A command that is being started begins no motion, and a homing ends.
        """
        axis, report, left_s = self._axis, self._report, self._countdown(timeout_s)
        axis.activity.stops += 1
        axis.power.release(report.state)
        with axis.lock:
            axis.mode.bits = 0
            self.require_online()
            late = f"the servo did not go off within {timeout_s:g} s"
            self._require(lambda: not report.powered, left_s(), late)
            axis.hold()

    def clear_alarm(self, timeout_s: float) -> None:
        """Fault reset: bit 7 must rise, so it is sent as 0 first. Not after ``timeout_s``."""
        axis, report, left_s = self._axis, self._report, self._countdown(timeout_s)
        with axis.lock:
            self.require_online()
            # Just after the start the drive may not have reported its alarm yet.
            self._wait(lambda: report.state is not DriveState.UNKNOWN, min(_STEP_S, left_s()))
            if not report.in_alarm:
                return
            axis.mode.bits = 0
            self._wait(lambda: report.state is not DriveState.FAULT_REACTION_ACTIVE, left_s())
            for word in (Control.DISABLE_VOLTAGE, Control.FAULT_RESET):
                if left_s():
                    axis.power.control = int(word)
                    self._wait(partial(lambda sent: axis.controlword == sent, word), left_s())
            reset_ns = self._clock.now_ns()
            cleared = self._wait(lambda: not report.in_alarm, left_s())
            axis.power.control = int(Control.DISABLE_VOLTAGE)
            axis.power.lost = ""
            if not cleared:
                report.read_error_register()
                text = f"the alarm is still there after {timeout_s:g} s: {report.alarm_text}"
                raise self._error(DeviceTimeout, text)
            axis.drive.node.forget_emergency_before(reset_ns)  # not every drive reports its end

    def set_mode(self, mode: CommandMode) -> None:
        axis = self._axis
        with axis.lock:
            self.require_online()  # a lost drive may receive, and its position is not known
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

    def leave_torque(self) -> None:
        """Stop an axis that is in cyclic torque mode and will not stream."""
        axis = self._axis
        with axis.lock:
            if axis.mode.requested.is_torque:
                axis.activity.begin(Operation.STREAM)
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

    def move(self, target: float, profile: Profile) -> None:
        """Profile position: write changed ramps by SDO; the control loop runs the handshake."""
        axis = self._axis
        stops = axis.activity.stops
        with axis.lock:
            self._prepare_motion(stops)
            axis.activity.complete = False
            axis.drive.set_value(0x6081, 0, self._speed_units(profile.velocity))
            profile = self._write_ramps(profile)
            self._require_no_stop(stops)
            axis.begin_move(target, profile)
            self._require_no_stop(stops)

    def jog(self, profile: Profile) -> None:
        """Profile or cyclic synchronous velocity."""
        axis = self._axis
        stops = axis.activity.stops
        if TARGET_VELOCITY not in axis.drive.outputs:
            raise self._error(NotReady, "no PDO holds 0x60FF (target velocity)")
        self._speed_units(profile.velocity)
        with axis.lock:
            self._prepare_motion(stops)
            mode, setpoint = VELOCITY_MODES[axis.options.velocity_mode], axis.setpoint
            if mode is OperationMode.PROFILE_VELOCITY:
                profile = self._write_ramps(profile)
            if axis.mode.requested is not mode:
                setpoint.target_velocity = setpoint.velocity = 0.0
                self._enter(mode)
            self._require_no_stop(stops)
            setpoint.acceleration = profile.acceleration
            setpoint.deceleration = profile.deceleration
            axis.mode.bits = 0
            axis.activity.complete = False
            setpoint.target_velocity = profile.velocity
            axis.estimate.run(profile.velocity, profile.acceleration, profile.deceleration)
            if profile.velocity or not axis.activity.is_idle:
                axis.activity.begin(Operation.VELOCITY)
            self._require_no_stop(stops)

    def home(self, timeout_s: float) -> None:
        """Homing mode with the configured method; 35 and 37 do not move."""
        axis, drive, options = self._axis, self._axis.drive, self._axis.options
        stops, braking_s = axis.activity.stops, 0.0
        with axis.lock:
            self._prepare_motion(stops)
            axis.activity.home_done = False
            drive.set_value(0x6098, 0, options.homing_method)
            if options.homing_method not in _HERE:
                speeds = options.homing_speed_rad_s, options.homing_creep_rad_s
                for sub, speed in enumerate(speeds, 1):
                    drive.set_value(0x6099, sub, self._speed_units(speed))
                ramp = axis.scaling.ramp_units(options.homing_acceleration_rad_s2)
                drive.set_value(0x609A, 0, ramp)
                braking_s = max(speeds) / options.homing_acceleration_rad_s2
            self._require_no_stop(stops)
            try:
                self._enter(OperationMode.HOMING)
                self._run_homing(timeout_s, stops)
            finally:
                # End the drive's own motion; then every value is from after it.
                axis.mode.bits = 0
                if not axis.activity.is_idle:
                    axis.activity.begin_stop()
                    if not self._wait(lambda: axis.activity.is_idle, braking_s + _STEP_S):
                        axis.power.quick_stop()  # some drives do not watch the bit
                        self._wait(lambda: axis.activity.is_idle, _STEP_S)
                self._wait_for_fresh_values()
                axis.report.rebase()
                axis.setpoint.position = axis.report.position
                axis.mode.requested = self._rest_mode()
                axis.hold()
            self._enter(axis.mode.requested)
            axis.activity.home_done = True

    def stop(self) -> None:
        """Controlled stop; the control loop does the rest. A command that runs begins no motion."""
        self._axis.brake(self._stop_ramp())

    def quick_stop(self) -> None:
        """The drive's own quick stop; the axis stays powered. As ``stop``.

        Of a command that ends with a harder ramp it is a stop: the drive's own is gentler.
        """
        axis, ramp = self._axis, self._axis.options.quick_stop_deceleration_rad_s2
        moving = not axis.activity.is_idle
        if moving and self._stop_ramp() > ramp:
            self.stop()
            return
        axis.brake(ramp)
        if moving:
            axis.power.quick_stop()

    def require_online(self) -> None:
        node = self._axis.drive.node
        if not node.online:
            raise self._error(NotReady, node.fault or "offline")

    def _run_homing(self, timeout_s: float, stops: int) -> None:
        axis, report, activity = self._axis, self._report, self._axis.activity
        activity.begin(Operation.HOMING)
        self._require_no_stop(stops)
        axis.mode.bits = int(Control.START_HOMING)
        started = self._wait(lambda: bool(axis.controlword & Control.START_HOMING), _STEP_S)
        self._wait_for_fresh_values()  # until then the statusword may be that of the homing before
        done = Status.HOMING_ATTAINED | Status.TARGET_REACHED

        def failed() -> bool:
            interrupted = activity.operation is not Operation.HOMING
            return interrupted or bool(report.statusword & Status.HOMING_ERROR)

        def ended() -> bool:
            return report.statusword & done == done or failed()

        if not started or not self._wait(ended, timeout_s):
            text = f"homing did not end within {timeout_s:g} s, {self._status()}"
            raise self._error(DeviceTimeout, text)
        if failed():
            raise self._error(OperationError, f"homing failed, {self._status()}")

    def _stop_ramp(self) -> float:
        """Return the deceleration of a stop now, rad/s² or m/s²."""
        axis = self._axis
        if axis.activity.operation is Operation.STREAM:
            return axis.options.stop_deceleration_rad_s2
        return axis.setpoint.deceleration

    def _wait_for_fresh_values(self) -> None:
        """Wait until every value is from after the present frame."""
        drive = self._axis.drive
        fresh = drive.frames + _FRESH_FRAMES + drive.turn
        self._wait(lambda: drive.frames >= fresh, _STEP_S + drive.turn * self._report.period_s)

    def _prepare_motion(self, stops: int) -> None:
        """Require power, without a quick stop. The ramp of a stop since ``stops`` stays."""
        self._require_power()
        self._recover()
        self._require_no_stop(stops)

    def _require_no_stop(self, stops: int) -> None:
        """Raise OperationError, with the axis stopped, after a stop since ``stops`` of them."""
        if self._axis.activity.stops != stops:
            self.stop()
            raise self._error(OperationError, "stopped before the motion began")

    def _rest_mode(self) -> OperationMode:
        """Mode of an axis without a command."""
        return rest_mode(self._axis.options, self._axis.mode.command_mode)

    def _enter(self, mode: OperationMode) -> None:
        """Change the mode of a powered axis at rest; wait for the mode display."""
        axis, report = self._axis, self._report
        if report.displayed_mode != mode or axis.mode.requested is not mode:
            if not axis.mode.requested.is_cyclic_position:
                axis.setpoint.position = axis.present_position()
            axis.setpoint.velocity = 0.0
            axis.mode.requested = mode
        if not self._wait(lambda: report.displayed_mode == mode, _STEP_S):
            shown = f"the drive shows mode {report.displayed_mode} after {_STEP_S:g} s"
            text = f"mode {mode.name.lower()} was requested, {shown}"
            raise self._error(DeviceTimeout, text)
        if mode.is_cyclic_position:
            axis.mode.bits = 0

    def _enter_torque(self) -> None:
        """Enter the cyclic torque mode, with the torque that holds the axis."""
        axis = self._axis
        if TARGET_TORQUE not in axis.drive.outputs:
            raise self._error(NotReady, "no PDO holds 0x6071 (target torque)")
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
        self._require(lambda: axis.activity.is_idle, braking_s + _STEP_S, late)
        axis.setpoint.stand_at(axis.present_position())
        if axis.mode.requested.is_torque:
            axis.mode.requested = self._rest_mode()
        torque = OperationMode.CYCLIC_TORQUE
        if not self._wait(lambda: report.displayed_mode != torque, _STEP_S):
            text = "the drive remains in its torque mode; switch the servo off and on"
            raise self._error(DeviceTimeout, text)
        if axis.mode.requested is OperationMode.PROFILE_POSITION:
            axis.mode.bits |= Control.HALT
        axis.power.leave_quick_stop()
        late = "the drive remains in quick stop"
        self._require(lambda: report.state is DriveState.OPERATION_ENABLED, _STEP_S, late)

    def _write_ramps(self, profile: Profile) -> Profile:
        """Write the ramps; return the profile with those that the drive has.

        Without 0x6084, which is optional, it has one ramp: that which stops in time.
        """
        scaling, drive = self._axis.scaling, self._axis.drive
        if not drive.set_optional(0x6084, scaling.ramp_units(profile.deceleration)):
            profile = replace(profile, acceleration=profile.deceleration)
        drive.set_value(0x6083, 0, scaling.ramp_units(profile.acceleration))
        return profile

    def _speed_units(self, velocity: float) -> int:
        """Return the velocity units of a speed. Raises InvalidArgument where they are 0."""
        scaling = self._axis.scaling
        units = abs(scaling.velocity_units(velocity))
        if velocity and not units:
            unit = abs(scaling.velocity)
            text = f"a velocity of {velocity:g} is less than half a unit of the drive, {unit:.3g}"
            raise self._error(InvalidArgument, text)
        return units

    def _require_power(self) -> None:
        self.require_online()
        self._require_no_alarm()
        if not self._report.powered:
            lost = f": {self._axis.power.lost}" if self._axis.power.lost else ""
            raise self._error(NotReady, f"the servo is off{lost}")

    def _require_no_alarm(self) -> None:
        if self._report.in_alarm:
            self._report.read_error_register()
            raise self._error(NotReady, f"the drive is in alarm: {self._report.alarm_text}")

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
