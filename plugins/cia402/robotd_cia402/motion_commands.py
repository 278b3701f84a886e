"""Motion that one axis makes by itself: move, jog, homing, and their stops."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace

from robotd.api import (
    DeviceTimeout,
    InvalidArgument,
    NotReady,
    Operation,
    OperationError,
    Profile,
    RobotdError,
)
from robotd_cia402.command_steps import STEP_TIMEOUT_S, CommandSteps
from robotd_cia402.controlword import Control, StatusBits
from robotd_cia402.modes import HOMING_AT_REST, VELOCITY_MODES, OperationMode
from robotd_cia402.object_numbers import TARGET_VELOCITY
from robotd_cia402.scaling import wrapped


class MotionCommands(CommandSteps):
    """Commands that begin a motion, and stops of any motion."""

    def move(self, target: float, profile: Profile) -> None:
        """Profile position: write changed ramps by SDO; the control loop runs the handshake."""
        axis = self._axis
        stops = axis.activity.stops
        with axis.lock:
            self._require_reach(target)
            self._prepare_motion(stops)
            axis.activity.complete = False
            axis.drive.set_value(0x6081, 0, self._speed_units(profile.velocity))
            profile = self._write_ramps(profile)
            if not axis.drive.maps_mode:
                self._enter(OperationMode.PROFILE_POSITION)
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
            if axis.mode.requested is not mode or axis.activity.is_idle:
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

    def home(self, timeout_s: float, max_speed: float = math.inf) -> None:
        """Run the configured homing method, which moves unless it is one at rest.

        ``max_speed``: bound of the speeds of a method that moves, rad/s or m/s.
        """
        axis, drive, options = self._axis, self._axis.drive, self._axis.options
        stops, braking_s = axis.activity.stops, 0.0
        with axis.lock:
            self._prepare_motion(stops)
            axis.activity.home_done = False
            drive.set_value(0x6098, 0, options.homing_method)
            if options.homing_method not in HOMING_AT_REST:
                configured = options.homing_speed_rad_s, options.homing_creep_rad_s
                speeds = [min(speed, max_speed) for speed in configured]
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
                    if not self._wait(lambda: axis.activity.is_idle, braking_s + STEP_TIMEOUT_S):
                        axis.power.quick_stop()  # some drives do not watch the bit
                        self._wait(lambda: axis.activity.is_idle, STEP_TIMEOUT_S)
                if not self._wait_for_fresh_values():
                    # The zero may have moved: a command from before would be a jump.
                    axis.power.release(axis.report.state)
                axis.report.rebase()
                axis.setpoint.position = axis.report.position
                axis.mode.requested = self._rest_mode()
                axis.hold()
                with suppress(RobotdError):  # below it is tried again; the reason is the homing
                    self._change_by_sdo(axis.mode.requested)
            self._enter(axis.mode.requested)
            axis.activity.home_done = True

    def stop(self) -> None:
        """Controlled stop; the control loop does the rest. A command that runs begins no motion."""
        self._axis.brake(self._stop_ramp())

    def quick_stop(self) -> None:
        """The drive's own quick stop; the axis stays powered. As ``stop``.

        A command whose ``stop`` has a harder ramp than the drive's quick stop is stopped by that.
        """
        axis, ramp = self._axis, self._axis.options.quick_stop_deceleration_rad_s2
        moving = not axis.activity.is_idle
        if moving and self._stop_ramp() > ramp:
            self.stop()
            return
        axis.brake(ramp)
        if moving:
            axis.power.quick_stop()

    def _require_reach(self, target: float) -> None:
        """Raise InvalidArgument for a target that wraps to another place: it is too far away."""
        scaling = self._axis.scaling
        way = scaling.counts(target) - scaling.counts(self._report.demand())
        if wrapped(way) != way:
            text = f"target {target:g} is {abs(way)} counts away, which has to be less than 2^31"
            raise self._error(InvalidArgument, text)

    def _run_homing(self, timeout_s: float, stops: int) -> None:
        axis, report, activity = self._axis, self._report, self._axis.activity
        activity.begin(Operation.HOMING)
        self._require_no_stop(stops)
        axis.mode.bits = int(Control.START_HOMING)
        started = self._wait(lambda: bool(axis.controlword & Control.START_HOMING), STEP_TIMEOUT_S)
        # Until then the statusword may be that of the homing before.
        started = started and self._wait_for_fresh_values()
        done = StatusBits.HOMING_ATTAINED | StatusBits.TARGET_REACHED

        def failed() -> bool:
            interrupted = activity.operation is not Operation.HOMING
            return interrupted or bool(report.statusword & StatusBits.HOMING_ERROR)

        def ended() -> bool:
            return report.statusword & done == done or failed()

        if not (started and self._wait(ended, timeout_s)) or failed():
            raise self._homing_error(timeout_s, stops)

    def _homing_error(self, timeout_s: float, stops: int) -> RobotdError:
        """Return why a homing has not been completed; one that goes on in spite of it is stopped.

        The error bit means an axis at rest with *target reached*, and one that moves without it
        (CiA 402-2, statusword of the homing mode).
        """
        axis, report = self._axis, self._report
        homing = f"homing by method {axis.options.homing_method} (0x6098)"
        if axis.activity.stops != stops:
            return self._error(OperationError, f"{homing} was stopped; the axis is not homed")
        if report.in_alarm:
            report.read_error_register()
            text = f"{homing} ended in an alarm of the drive: {report.alarm_text}"
            return self._error(OperationError, text)
        if report.known and not report.powered:
            text = f"{homing} ended because the servo went off: {axis.power.lost or self._status()}"
            return self._error(OperationError, text)
        if not report.statusword & StatusBits.HOMING_ERROR:
            text = f"{homing} did not end within {timeout_s:g} s, {self._status()}"
            text += "; raise homing_speed_rad_s or engine.homing_timeout_s, or check the switch"
            return self._error(DeviceTimeout, text)
        how, status = "at rest", self._status()
        if not report.statusword & StatusBits.TARGET_REACHED:
            how = "in motion; it is stopped by a quick stop"
            axis.power.quick_stop()
        text = f"{homing} failed: the drive reports a homing error {how}, {status}"
        text += "; check that it has the method, and the switches or index pulse that this needs"
        return self._error(OperationError, text)

    def _stop_ramp(self) -> float:
        """Return the deceleration of a stop now, rad/s² or m/s²."""
        axis = self._axis
        if axis.activity.operation is Operation.STREAM:
            return axis.options.stop_deceleration_rad_s2
        return axis.setpoint.deceleration

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
