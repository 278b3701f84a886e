"""Commands on one axis that need several steps; worker threads, one at a time for each axis."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from robotd.api import (
    NANOSECONDS,
    Clock,
    CommandMode,
    DeviceTimeout,
    NotReady,
    Operation,
    OperationError,
    Profile,
    wait_until,
)
from robotd_canopen.axis import Axis
from robotd_canopen.modes import CYCLIC, STREAM_MODES, VELOCITY_MODES, OperationMode, rest_mode
from robotd_canopen.states import FAULTY, TOWARDS_ENABLED, Control, DriveState, Status

_HERE = (35, 37)  # homing methods that take the present position
_STEP_S = 1.0  # for a change of mode or a handshake
_FRESH_SYNCS = 5  # after which every value is from after the event


class Commands:
    """What a worker asks of one axis. Every wait ends with a text that names node and state."""

    def __init__(self, axis: Axis, clock: Clock) -> None:
        self._axis, self._clock = axis, clock

    def enable(self, timeout_s: float) -> None:
        """Operation enabled, with the command at the measured position."""
        axis = self._axis
        with axis.lock:
            self.require_online()
            deadline_ns = self._clock.now_ns() + round(timeout_s * NANOSECONDS)
            axis.bits, axis.lost = 0, ""
            axis.mode = rest_mode(axis.layout.options, axis.command_mode)
            while axis.state is not DriveState.OPERATION_ENABLED:
                self._require_no_alarm()
                left_s = (deadline_ns - self._clock.now_ns()) / NANOSECONDS
                if left_s <= 0 or not self._next_state(left_s):
                    axis.control = int(Control.DISABLE_VOLTAGE)
                    raise DeviceTimeout(
                        f"{axis.node.name}: the servo did not go on within {timeout_s:g} s,"
                        f" {self._status()}"
                    )
            self._enter(axis.mode)
            axis.wanted = True

    def disable(self, timeout_s: float) -> None:
        """Power off, to ready to switch on."""
        axis = self._axis
        with axis.lock:
            axis.wanted = False
            axis.control, axis.bits = int(Control.SHUTDOWN), 0
            self.require_online()
            if not self._wait(lambda: not axis.powered, timeout_s):
                raise DeviceTimeout(
                    f"{axis.node.name}: the servo did not go off within {timeout_s:g} s,"
                    f" {self._status()}"
                )
            axis.hold()

    def clear_alarm(self, timeout_s: float) -> None:
        """Fault reset: bit 7 must rise, so it is sent as 0 first."""
        axis = self._axis
        with axis.lock:
            self.require_online()
            # Just after the start the drive may not have said yet that it is in alarm.
            self._wait(lambda: axis.state is not DriveState.UNKNOWN, _STEP_S)
            if axis.state not in FAULTY:
                return
            axis.bits = 0
            self._wait(lambda: axis.state is not DriveState.FAULT_REACTION_ACTIVE, timeout_s)
            for word in (Control.DISABLE_VOLTAGE, Control.FAULT_RESET):
                axis.control = int(word)
                self._wait(partial(self._was_sent, int(word)), _STEP_S)
            cleared = self._wait(lambda: axis.state not in FAULTY, timeout_s)
            axis.control = int(Control.DISABLE_VOLTAGE)
            axis.lost = ""
            if not cleared:
                raise DeviceTimeout(
                    f"{axis.node.name}: the alarm is still there after {timeout_s:g} s:"
                    f" {self.alarm_text()}"
                )

    def set_mode(self, mode: CommandMode) -> None:
        axis = self._axis
        with axis.lock:
            wanted = rest_mode(axis.layout.options, mode)
            if axis.powered:
                self._recover()
                self._enter(wanted)
            else:
                axis.mode = wanted
            axis.command_mode = mode

    def prepare_stream(self) -> None:
        """The stream's mode, with the command where it is."""
        axis = self._axis
        with axis.lock:
            self._require_power()
            if axis.following:
                return
            self._recover()
            if axis.command_mode is CommandMode.VELOCITY:
                ramp = axis.layout.options.stop_deceleration_rad_s2
                self._write_ramps(Profile(0.0, ramp, ramp))
                self._enter(rest_mode(axis.layout.options, axis.command_mode))
            else:
                self._enter(STREAM_MODES[axis.layout.options.stream_mode])
            axis.velocity = 0.0

    def begin_stream(self) -> None:
        """From now on the cycle's setpoints are obeyed; ``prepare_stream`` came first."""
        axis = self._axis
        with axis.lock:
            axis.complete = False
            axis.operation, axis.following = Operation.STREAM, True

    def end_stream(self) -> None:
        """Hold the last setpoint; still moving there, brake."""
        axis = self._axis
        with axis.lock:
            if not axis.following:
                return
            if abs(axis.velocity) > 1e-3:
                axis.brake(axis.layout.options.stop_deceleration_rad_s2)
                return
            axis.hold()
            axis.complete = True

    def move(self, target: float, profile: Profile) -> None:
        """Profile position: ramps by SDO where they are new; the cycle does the handshake."""
        axis = self._axis
        with axis.lock:
            self._require_power()
            self._recover()
            axis.complete = False
            self._write_profile(profile)
            axis.begin_move(target, profile)

    def jog(self, profile: Profile) -> None:
        """Profile or cyclic synchronous velocity."""
        axis = self._axis
        with axis.lock:
            self._require_power()
            self._recover()
            axis.acceleration, axis.deceleration = profile.acceleration, profile.deceleration
            mode = VELOCITY_MODES[axis.layout.options.velocity_mode]
            if mode is OperationMode.PROFILE_VELOCITY:
                self._write_ramps(profile)
            if axis.mode is not mode:
                axis.target_velocity = axis.velocity = 0.0
                self._enter(mode)
            axis.bits, axis.complete = 0, False
            axis.target_velocity = profile.velocity
            axis.estimate.run(profile.velocity, profile.acceleration, profile.deceleration)
            if profile.velocity or axis.operation is not Operation.IDLE:
                axis.operation = Operation.VELOCITY

    def home(self, timeout_s: float) -> None:
        """Homing mode with the configured method; 35 and 37 do not move."""
        axis, options = self._axis, self._axis.layout.options
        with axis.lock:
            self._require_power()
            self._recover()
            axis.home_done = False
            self._write(0x6098, 0, options.homing_method)
            if options.homing_method not in _HERE:
                speeds = options.homing_speed_rad_s, options.homing_creep_rad_s
                for sub, speed in enumerate(speeds, 1):
                    self._write(0x6099, sub, abs(axis.scaling.velocity_units(speed)))
                ramp = axis.scaling.ramp_units(options.homing_acceleration_rad_s2)
                self._write(0x609A, 0, ramp)
            try:
                self._enter(OperationMode.HOMING)
                self._run_homing(timeout_s)
            finally:
                axis.bits = 0
                seen = axis.syncs
                self._wait(lambda: axis.syncs > seen + _FRESH_SYNCS, _STEP_S)
                axis.rebase()
                axis.position = axis.measured
                axis.mode = rest_mode(options, axis.command_mode)
                axis.hold()
            self._enter(axis.mode)
            axis.home_done = True

    def stop(self) -> None:
        """Controlled stop; the cycle does the rest."""
        axis = self._axis
        streamed = axis.operation is Operation.STREAM
        axis.brake(axis.layout.options.stop_deceleration_rad_s2 if streamed else axis.deceleration)

    def quick_stop(self) -> None:
        """The drive's own quick stop; the axis stays powered."""
        axis = self._axis
        if axis.operation is not Operation.IDLE:
            axis.brake(axis.layout.options.quick_stop_deceleration_rad_s2)
            axis.control = int(Control.QUICK_STOP)

    def require_online(self) -> None:
        node = self._axis.node
        if not node.online:
            raise NotReady(node.complaint)

    def alarm_text(self) -> str:
        """Why the drive is in alarm."""
        return self._axis.node.alarm_text(self._axis.error_code())

    def _run_homing(self, timeout_s: float) -> None:
        axis = self._axis
        axis.operation = Operation.HOMING
        axis.bits = int(Control.START_HOMING)
        started = self._wait(lambda: bool(axis.sent & Control.START_HOMING), _STEP_S)
        done = Status.HOMING_ATTAINED | Status.TARGET_REACHED
        ended = started and self._wait(
            lambda: axis.status & done == done or bool(axis.status & Status.HOMING_ERROR)
            or axis.operation is not Operation.HOMING,
            timeout_s,
        )  # fmt: skip
        if not ended:
            raise DeviceTimeout(
                f"{axis.node.name}: homing did not end within {timeout_s:g} s, {self._status()}"
            )
        if axis.status & Status.HOMING_ERROR or axis.operation is not Operation.HOMING:
            raise OperationError(f"{axis.node.name}: homing failed, {self._status()}")

    def _was_sent(self, word: int) -> bool:
        return self._axis.sent == word

    def _next_state(self, timeout_s: float) -> bool:
        """One transition towards operation enabled."""
        axis, state = self._axis, self._axis.state
        axis.control = int(TOWARDS_ENABLED.get(state, Control.DISABLE_VOLTAGE))
        return self._wait(lambda: axis.state is not state, timeout_s)

    def _enter(self, mode: OperationMode) -> None:
        """Change the mode of a powered axis at rest and wait until the drive shows it."""
        axis = self._axis
        if axis.displayed_mode != mode or axis.mode is not mode:
            if axis.mode not in CYCLIC:
                axis.position = axis.demand()
            axis.velocity = 0.0
            axis.mode = mode
        if not self._wait(lambda: axis.displayed_mode == mode, _STEP_S):
            raise DeviceTimeout(
                f"{axis.node.name}: mode {mode.name.lower()} was asked for, the drive shows"
                f" mode {axis.displayed_mode} after {_STEP_S:g} s"
            )
        if mode in CYCLIC:
            axis.bits = 0

    def _recover(self) -> None:
        """Out of a quick stop (transition 16), with the command where the axis stands."""
        axis = self._axis
        if axis.state is DriveState.QUICK_STOP_ACTIVE:
            axis.position, axis.velocity, axis.target_velocity = axis.demand(), 0.0, 0.0
            axis.bits |= Control.HALT if axis.mode is OperationMode.PROFILE_POSITION else 0
            axis.control = int(Control.ENABLE_OPERATION)
            if not self._wait(lambda: axis.state is DriveState.OPERATION_ENABLED, _STEP_S):
                raise DeviceTimeout(
                    f"{axis.node.name}: the drive stays in quick stop, {self._status()}"
                )

    def _write_profile(self, profile: Profile) -> None:
        scaling = self._axis.scaling
        self._write(0x6081, 0, abs(scaling.velocity_units(profile.velocity)))
        self._write_ramps(profile)
        self._axis.deceleration = profile.deceleration

    def _write_ramps(self, profile: Profile) -> None:
        scaling = self._axis.scaling
        self._write(0x6083, 0, scaling.ramp_units(profile.acceleration))
        self._write(0x6084, 0, scaling.ramp_units(profile.deceleration))

    def _write(self, base: int, sub: int, value: int) -> None:
        """Write a profile object, unless the drive has that value by us."""
        axis, key = self._axis, base << 8 | sub
        if axis.profile_written.get(key) != value:
            axis.node.sdo.write(axis.layout.index(base), sub, value)
            axis.profile_written[key] = value

    def _require_power(self) -> None:
        self.require_online()
        self._require_no_alarm()
        if not self._axis.powered:
            lost = f": {self._axis.lost}" if self._axis.lost else ""
            raise NotReady(f"{self._axis.node.name}: the servo is off{lost}")

    def _require_no_alarm(self) -> None:
        if self._axis.state in FAULTY:
            raise NotReady(f"{self._axis.node.name}: the drive is in alarm: {self.alarm_text()}")

    def _status(self) -> str:
        axis = self._axis
        if not axis.node.online:
            return axis.node.fault
        return f"statusword 0x{axis.status:04X} ({axis.state.value})"

    def _wait(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Wait, or give up early when the node is lost."""
        axis = self._axis
        met = wait_until(lambda: condition() or not axis.node.online, timeout_s, self._clock)
        return met and axis.node.online and condition()
