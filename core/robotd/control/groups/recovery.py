"""Recovery after a fault: cause, reconnection, alarms, servos, verification."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Sequence

import numpy as np

from robotd.clock import NANOSECONDS, wait_until
from robotd.control.groups.problem import Problem, ProblemKind
from robotd.control.groups.problem_finder import Problems
from robotd.control.groups.servos import Servos
from robotd.device.axes import Axes, each
from robotd.device.fieldbus import Fieldbus
from robotd.errors import ConnectError, NotReady, RobotdError, reason_of
from robotd.log import get_logger

log = get_logger("recovery")

READY_TIMEOUT_S = 1.0  # for values to be fresh after communication has started
SETTLING_TIME_S = 0.2  # without a change, after which the states of restarted drives are final
VERIFICATION_TIME_S = 1.0  # without a problem, after which a recovery is verified
WATCH_POLL_S = 0.01
NOTHING_WRONG = "nothing is wrong: no axis has a fault"

Report = Callable[[str], None]

_NOT_TWICE = (ProblemKind.CONTROLLER, ProblemKind.ALARM)  # may be a short circuit


class Recovery:
    """Brings a robot back to where it takes commands, step by step. Nothing moves.

    Cause → connection → rest → alarms → servos → verification. The first step that fails ends it.
    Servos are switched on as at start: at the measured position, without a jump. What goes off or
    is lost during verification, without an alarm, is brought back once more: drives that are lost
    together are not noticed together. So is a device that is lost before.
    """

    def __init__(self, axes: Axes, fieldbus: Fieldbus, problems: Problems, servos: Servos) -> None:
        self._connection, self._axes, self._fieldbus = axes.connection, axes, fieldbus
        self._used, self._enable, self._clock = list(servos.used), servos.enable_axis, axes.clock
        self._find_problems = problems.recoverable
        self._running = threading.Lock()

    def run(self, report: Report = lambda line: None) -> None:
        """Recover; a worker, seconds where the device needs them.

        ``report``: called with each step when it begins or has ended, in the same thread.

        Raises:
            NotReady: another recovery runs, or the robot is being shut down.
            OperationError: the axes are read-only.
            ConnectError: the step that failed, with the reason of each axis.
            RobotdError: the device cannot be opened or started.
        """
        self._axes.stop_latch.check_commandable()
        if not self._running.acquire(blocking=False):
            raise NotReady("another recovery is running")

        def logged(line: str) -> None:
            log.info("recovery", step=line)
            report(line)

        try:
            self._connection.require_alive()
            self._recover(logged)
        finally:
            self._running.release()

    def _recover(self, report: Report) -> None:
        self._connection.update_ready()  # a loss may be younger than the last period
        found = self._find_problems()
        for line in [f"found: {problem}" for problem in found] or [NOTHING_WRONG]:
            report(line)
        if not found:
            return
        was_ready = self._connection.ready
        try:
            before = self._bring_back(report)
        except RobotdError as error:
            self._connection.update_ready()
            if not was_ready or self._connection.ready or self._connection.ending:
                raise
            # The alarm of a drive was the first sign that the device is being lost.
            report(f"lost meanwhile: {self._connection.reason or error}")
            before = self._bring_back(report)
        left = self._watch()
        if left and not any(problem.kind in _NOT_TWICE for problem in left):
            report(f"not stable yet: {'; '.join(map(str, left))}")
            self._bring_back(report)
            left = self._watch()
        if left:
            raise NotReady(f"not recovered: {'; '.join(map(str, left))}")
        self._report_success(before, report)

    def _bring_back(self, report: Report) -> dict[int, float]:
        """Reconnect, clear alarms, switch servos on; return the positions before of those axes."""
        if not self._connection.ready:
            self._reconnect(report)
        image = self._axes.image
        self._join_offline(report)
        alarms = [axis for axis in range(len(self._axes)) if image.amp_alarm[axis]]
        off = [axis for axis in self._used if not image.servo_on[axis]]
        before = {axis: float(image.position[axis]) for axis in {*alarms, *off}}
        self._await_rest()
        self._run_each(
            [axis for axis in range(len(self._axes)) if image.amp_alarm[axis]],
            self._axes.clear_alarm,
            "alarms cleared",
            "alarms cannot be cleared",
            report,
        )
        self._run_each(
            [axis for axis in self._used if not image.servo_on[axis]],
            self._enable,
            "servos on",
            "servos cannot be switched on",
            report,
        )
        return before

    def _reconnect(self, report: Report) -> None:
        report("reconnecting")
        began_s = time.monotonic()
        self._connection.restore()
        if not self._becomes_ready():
            report(f"no fresh values ({self._connection.reason}): closing and opening the device")
            self._connection.close()
            self._connection.restore()
        if not self._becomes_ready():
            raise NotReady(self._connection.rejection)
        report(f"reconnected after {time.monotonic() - began_s:.1f} s")
        self._settle()

    def _becomes_ready(self) -> bool:
        connection = self._connection
        timeout_s = READY_TIMEOUT_S + connection.settings.stale_after_s
        fresh = wait_until(lambda: connection.ready, timeout_s, self._clock)
        return fresh and wait_until(lambda: bool(self._axes.image.stamp_ns), timeout_s, self._clock)

    def _settle(self) -> None:
        """Wait until restarted drives report a state that lasts.

        They were enabled before, and report it until they obey their first command.
        """
        since_ns, flags = self._clock.now_ns(), self._axes.image.copy().flags

        def settled() -> bool:
            nonlocal since_ns, flags
            image = self._axes.image.copy()
            if not np.array_equal(image.flags, flags):
                since_ns, flags = self._clock.now_ns(), image.flags
            lasts = image.fresh_ns - since_ns >= SETTLING_TIME_S * NANOSECONDS
            return lasts or not self._connection.ready

        wait_until(settled, READY_TIMEOUT_S + self._connection.settings.stale_after_s, self._clock)

    def _join_offline(self, report: Report) -> None:
        """Let drives join the bus again where the backend can do that at run time."""
        image, timeout_s = self._axes.image, self._connection.settings.servo_timeout_s
        # After a start a drive may need some periods.
        wait_until(lambda: not image.offline[self._used].any(), READY_TIMEOUT_S, self._clock)
        offline = [axis for axis in self._used if image.offline[axis]]
        if not offline:
            return
        report(f"connecting again: {self._names(offline)}")
        for bus in range(self._fieldbus.buses):
            try:
                self._fieldbus.start_hot_connect(bus)
            except RobotdError as error:
                report(f"fieldbus {bus}: {error}")
        wait_until(lambda: not image.offline[offline].any(), timeout_s, self._clock)
        _raise_failures(
            "drives are offline: check their power and cables",
            {self._axes.names[axis]: image.fault(axis) for axis in offline if image.offline[axis]},
        )

    def _await_rest(self) -> None:
        """Wait until faulty axes are at rest and released by the source that moved them."""
        axes, image = self._axes, self._axes.image
        faulty = [
            axis
            for axis in range(len(axes))
            if image.amp_alarm[axis] or (axis in self._used and not image.servo_on[axis])
        ]
        timeout_s = self._connection.settings.servo_timeout_s
        if faulty:
            axes.stop_and_wait(faulty, timeout_s)
        owned = {axis for axis in faulty if axes.owner(axis)}
        if not wait_until(lambda: not any(map(axes.owner, owned)), timeout_s, self._clock):
            axis = min(axis for axis in owned if axes.owner(axis))
            raise NotReady(f"{axes.names[axis]}: in use by {axes.owner(axis)}")

    def _run_each(
        self,
        axes: Sequence[int],
        command: Callable[[int], None],
        done: str,
        failed: str,
        report: Report,
    ) -> None:
        if not axes:
            return
        results = each(axes, command)
        good = [axis for axis, error in results.items() if error is None]
        if good:
            report(f"{done}: {self._names(good)}")
        _raise_failures(
            failed,
            {
                self._axes.names[axis]: reason_of(error)
                for axis, error in results.items()
                if error is not None
            },
        )

    def _watch(self) -> list[Problem]:
        """Return the problems that show within ``VERIFICATION_TIME_S`` after the last command.

        Values from before it say nothing: nodes that were lost with others may not be noticed yet.
        """
        connection, image = self._connection, self._axes.image
        begun_ns, stale_s = self._clock.now_ns(), connection.settings.stale_after_s
        problems: list[Problem] = []

        def ended() -> bool:
            problems[:] = self._find_problems()
            lasts = image.fresh_ns - begun_ns >= VERIFICATION_TIME_S * NANOSECONDS
            return lasts or bool(problems)

        if not wait_until(
            ended, VERIFICATION_TIME_S + READY_TIMEOUT_S + stale_s, self._clock, WATCH_POLL_S
        ):
            text = "the device sends no values from after the last command"
            return [Problem(ProblemKind.DEVICE, text)]
        return problems

    def _report_success(self, before: dict[int, float], report: Report) -> None:
        """Report the largest change of the axes that were brought back; others may be in motion."""
        position, most = self._axes.image.copy().position, ""
        moved = {axis: abs(float(position[axis]) - start) for axis, start in before.items()}
        moved = {axis: change for axis, change in moved.items() if math.isfinite(change)}
        if moved:
            axis = max(moved, key=lambda axis: moved[axis])
            unit, name = self._axes.limits[axis].unit, self._axes.names[axis]
            most = f"; largest change of position {moved[axis]:.4f} {unit} ({name})"
        on = f"{len(self._used)} axes on, no alarm" if self._used else "no alarm"
        report(f"verified: {on}{most}")

    def _names(self, axes: Sequence[int]) -> str:
        return ", ".join(self._axes.names[axis] for axis in axes)


def _raise_failures(message: str, failures: dict[str, str]) -> None:
    if failures:
        raise ConnectError(message, failures)
