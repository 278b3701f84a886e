"""Commands on the power stage of one axis: servo on and off, alarm."""

from __future__ import annotations

from functools import partial

from robotd.api import DeviceTimeout, NotReady, OperationError, RobotdError, get_logger
from robotd_cia402.command_steps import STEP_TIMEOUT_S, CommandSteps
from robotd_cia402.controlword import TOWARDS_ENABLED, Control, DriveState, StatusBits
from robotd_cia402.modes import TORQUE_MODES

log = get_logger("cia402")


class PowerCommands(CommandSteps):
    """Commands of the state machine."""

    _shows_following: bool | None = None  # the drive has bit 12 of the cyclic modes; None: unknown

    def enable(self, timeout_s: float) -> None:
        """Enable operation, with the command at the measured position.

        An axis that is on is left as it is, and taken out of a quick stop. Nothing is switched on
        after ``timeout_s``, after a ``disable`` that came meanwhile, or where two nodes answer.
        """
        axis, report, releases = self._axis, self._report, self._axis.power.releases
        left_s = self._countdown(timeout_s)

        def step(control: Control, *, done: bool = False) -> None:
            if not axis.power.switch_on(control, releases, done=done):
                raise self._error(OperationError, "switched off before the servo was on")

        axis.drive.require_unique(left_s())
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
            self._change_by_sdo(axis.mode.requested)
            # Without a torque an arm would fall. Some drives change their mode when they are on.
            limit_s = min(STEP_TIMEOUT_S, left_s() / 2)
            self._wait(lambda: report.displayed_mode not in TORQUE_MODES, limit_s)
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
                self.wait_for_brake(left_s())
                self.wait_until_followed(left_s() / 2)
            except RobotdError:
                axis.power.release(report.state)
                raise

    def wait_for_brake(self, timeout_s: float) -> None:
        """Wait until the brake is released. Raises DeviceTimeout after ``timeout_s``."""
        brake_s = self._axis.options.brake_release_s
        late = f"the {brake_s:g} s of brake_release_s do not fit into engine.servo_timeout_s"
        self._require(lambda: not self._axis.holding_brake.holds, timeout_s, late)

    def wait_until_followed(self, timeout_s: float) -> None:
        """Wait for a drive that shows in bit 12 that it ignores setpoints, as its brake opens.

        The bit is optional: a drive that has never set it is waited for once, and not beyond 1 s.
        """
        axis, report = self._axis, self._report
        if self._shows_following is False or not axis.mode.requested.has_following_bit:
            return
        follows = lambda: bool(report.statusword & StatusBits.FOLLOWS)  # noqa: E731
        if self._wait(follows, min(STEP_TIMEOUT_S, timeout_s)):
            self._shows_following = True
            return
        self._require_power()
        self._shows_following = self._shows_following or False
        text = "the drive is on and does not show that it follows setpoints (statusword bit 12)"
        effect = "if it has a brake, brake_release_s has to cover its release"
        log.warning(text, node=axis.drive.node.label, axis=axis.number, effect=effect)

    def _has_left(self, state: DriveState, releases: int) -> bool:
        return self._report.state is not state or self._axis.power.releases != releases

    def disable(self, timeout_s: float) -> None:
        """Switch the power stage off at once, whatever another command waits for.

        A command that is being started begins no motion, and a homing ends.
        """
        axis, report, left_s = self._axis, self._report, self._countdown(timeout_s)
        axis.activity.stops += 1
        self.leave_quick_stop()
        axis.power.release(report.state)
        with axis.lock:
            axis.mode.bits = 0
            self.require_online()
            late = f"the servo did not go off within {timeout_s:g} s"
            self._require(lambda: not report.powered, left_s(), late)
            axis.power.may_be_on = False
            axis.hold()

    def leave_quick_stop(self) -> None:
        """Enable operation at rest, to switch a drive off that holds a hanging load.

        Out of a quick stop it goes off by *disable voltage* only (transition 12), which takes the
        torque away before the brake holds. One that does not leave it is switched off all the same.
        """
        axis = self._axis
        stopped = self._report.state is DriveState.QUICK_STOP_ACTIVE
        if not (axis.options.hanging_load and stopped and axis.lock.acquire(blocking=False)):
            return
        try:
            self._recover()
        except RobotdError as error:
            text = "the load may fall: the drive is switched off in its quick stop"
            log.warning(text, axis=axis.number, reason=str(error))
        finally:
            axis.lock.release()

    def clear_alarm(self, timeout_s: float) -> None:
        """Fault reset: bit 7 must rise, so it is sent as 0 first. Not after ``timeout_s``."""
        axis, report, left_s = self._axis, self._report, self._countdown(timeout_s)
        with axis.lock:
            self.require_online()
            # Just after the start the drive may not have reported its alarm yet.
            self._wait(
                lambda: report.state is not DriveState.UNKNOWN, min(STEP_TIMEOUT_S, left_s())
            )
            if not report.in_alarm:
                self._require_mode(min(STEP_TIMEOUT_S, left_s()))
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
