"""Control loop: one named thread with absolute deadlines.

Each period: read the process image → check its age → advance streamed trajectories → call the
tasks that are due → sleep to the next deadline. A deadline that is missed is
counted and skipped, never made up for in a burst.
"""

from __future__ import annotations

import ctypes
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from robotd.clock import NANOSECONDS, Clock, MonotonicClock
from robotd.clock.simulated import PacedClock, SteppedClock
from robotd.control.loop_statistics import LoopStatistics
from robotd.control.setpoint_mixer import NOT_RUNNING, SetpointMixer
from robotd.control.watchdog import SIMULATED_HANG_S, Watchdog, place_of
from robotd.device.connection import Connection
from robotd.device.drivers import AxisDriver
from robotd.device.process_image import ProcessImage
from robotd.device.state import ConnectionState
from robotd.errors import RobotdError
from robotd.log import get_logger
from robotd.realtime import request_realtime

log = get_logger("cycle")

Task = Callable[[ProcessImage], None]

PR_SET_TIMERSLACK = 29  # linux/prctl.h
STOP_S = 2.0  # time-out for the current period; a thread that hangs is abandoned
SWITCH_INTERVAL_S = 1e-4  # longest wait for a Python thread that holds the interpreter
AHEAD_NS = 120_000  # other threads begin no work in this time before a period
WAITS, WAIT_S = 6, 5e-5  # in fact 0.1 ms each: wake-up latency of the system


@dataclass
class _Periodic:
    task: Task
    name: str
    period_ns: int
    first: bool
    due_ns: int = 0
    failing: bool = False


class ControlLoop:
    """Fixed-rate thread ``robotd-control``; only it calls ``AxisDriver.read`` and ``stream``.

    Args:
        driver: source of the process image and sink of setpoints.
        connection: gate of the reads, and the state of the device.
        image: process image that is filled each period.
        mixer: advances trajectories and sends setpoints.
        rate_hz: periods per second.
        realtime_priority: SCHED_FIFO priority to ask for, 1..99; 0 asks for none.
        clock: time base of the deadlines. On a ``SteppedClock`` there is no thread: periods
            run in the thread that sleeps on the clock.
    """

    def __init__(
        self,
        driver: AxisDriver,
        connection: Connection,
        image: ProcessImage,
        mixer: SetpointMixer,
        rate_hz: float,
        *,
        realtime_priority: int = 0,
        clock: Clock | None = None,
    ) -> None:
        self.stats = LoopStatistics()
        self.realtime = False
        self.period_ns = round(NANOSECONDS / rate_hz)
        self._driver = driver
        self._connection = connection
        self._image = image
        self._mixer = mixer
        self._priority = realtime_priority
        clock = clock or MonotonicClock()
        self._simulated = isinstance(clock, PacedClock)
        self._clock: Clock = clock.leader if isinstance(clock, PacedClock) else clock
        self._stale_after_ns = round(connection.settings.stale_after_s * NANOSECONDS)
        self._communicating_since_ns = 0
        self._tasks: list[_Periodic] = []
        self._read_failure: str | None = None
        self._lost: tuple[object, str] | None = None  # key and text of the reason
        self._lost_ns = 0  # time at which the device was lost; 0: it is not
        self._failing = False
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._due_ns = 0  # of the next or current period; 0: no thread has to wait for it
        self._late_ns = 0  # of deadlines missed since the last period
        self._advanced_ns = 0  # nominal time of the last setpoints
        self._began_ns = 0  # in real time: simulated time stops while a driver hangs
        limit_s = SIMULATED_HANG_S if self._simulated else connection.settings.stale_after_s
        self._watchdog = Watchdog(self._age_ns, lambda: place_of(self._thread), limit_s, self._hang)

    def every(self, rate_hz: float, name: str, task: Task, *, first: bool = False) -> None:
        """Call ``task(image)`` in the control-loop thread, at most ``rate_hz`` times a second.

        Only while the device communicates. A task must not block; an exception is logged
        once and does not stop the loop. Any thread may call, also while the loop runs.

        Args:
            rate_hz: on the clock of the control loop.
            name: for the log.
            task: called with the image.
            first: before the image is read, also while the device does not communicate.
        """
        self._tasks.append(_Periodic(task, name, round(NANOSECONDS / rate_hz), first))

    def delay(self, seconds: float) -> None:
        """Prolong the current period by ``seconds``; for tasks that inject faults."""
        if self._simulated:
            self._began_ns = 0  # excluded from the hang detection: no driver hangs
        self._clock.sleep_until_ns(self._clock.now_ns() + round(seconds * NANOSECONDS))
        self._began_ns = MonotonicClock.now_ns()

    def start(self) -> None:
        """Start the loop; no effect while it runs. One thread; not again after ``stop``."""
        if isinstance(self._clock, SteppedClock):
            self._clock.attach(self.period_ns, self.period)
        elif self._thread is None:
            self._thread = threading.Thread(target=self._run, name="robotd-control", daemon=True)
            self._thread.start()
            self._watchdog.start()

    def stop(self) -> None:
        """End the thread after its period and wait; a second call has no effect."""
        self._stop.set()
        self._watchdog.stop()
        if isinstance(self._clock, SteppedClock):
            self._clock.detach()
        if self._thread is not None:
            self._thread.join(STOP_S)
            if self._thread.is_alive():
                log.error("the control loop hangs; its thread is abandoned")
        self._mixer.device_lost(NOT_RUNNING)

    def period(self, deadline_ns: int) -> int:
        """Run the period of a deadline that has come; return the next deadline.

        A deadline that has passed by more than half a period is missed: its setpoint would come too
        late, and its SYNC so close to the next one that drives would count the two as one.

        Called by the thread, or by a ``SteppedClock``.
        """
        period_ns, stats = self.period_ns, self.stats
        start_ns = self._clock.now_ns()
        late_ns = start_ns - deadline_ns
        missed = self._overrun(deadline_ns)
        deadline_ns += missed * period_ns
        self._late_ns = max(self._late_ns, late_ns)
        if not missed or deadline_ns <= start_ns:
            self._began_ns = MonotonicClock.now_ns()
            self.step(deadline_ns)
            deadline_ns = max(deadline_ns, self._advanced_ns)
            self._began_ns = 0
            stats.record(self._late_ns, start_ns, self._clock.now_ns())
            self._late_ns = 0
            deadline_ns += period_ns
        if not self._simulated:
            self._due_ns = deadline_ns
        return deadline_ns

    def yield_to_control_loop(self) -> None:
        """Wait while a period is imminent or running, 1 ms at most. Any other thread.

        Avoids GIL convoying: threads that run many short callbacks release the GIL between two
        of them and re-acquire it before the control loop wakes. Its wait begins anew each time,
        so that it never requests the GIL after ``SWITCH_INTERVAL_S``. A burst of 50 messages
        delayed the control loop by 2 ms.
        """
        for _ in range(WAITS):
            if not self._due_ns or self._clock.now_ns() < self._due_ns - AHEAD_NS:
                return
            time.sleep(WAIT_S)

    def step(self, time_ns: int) -> None:
        """Run the work of a period at its nominal time ``time_ns``.

        The nominal time, not the jittery real one, drives trajectories. Called by ``period``,
        or by a test that owns the clock. An exception is logged once and ends all motion,
        never the control loop.
        """
        try:
            self._run_tasks(time_ns, first=True)
            self._live(time_ns)
            self._failing = False
        except Exception as error:
            if not self._failing:
                log.exception("a control period failed")
            self._failing = True
            self._mixer.device_lost(f"{type(error).__name__}: {error}")

    def _live(self, time_ns: int) -> None:
        state = self._connection.update_ready()
        if state not in (ConnectionState.COMMUNICATING, ConnectionState.UNKNOWN):
            self._lose(state, f"communication has ended (engine state {state.value})")
            if self._communicating_since_ns:
                self._communicating_since_ns = 0
                self._connection.set_stale(False)
                self._image.forget()
            self._report_loss(time_ns)
            return
        self._read(time_ns)
        if self._is_fresh(time_ns):
            overrun = self._overrun(time_ns) if self._mixer.extrapolates else 0
            self._advanced_ns = time_ns + overrun * self.period_ns
            self._mixer.advance(self._advanced_ns, self._image)
        self._report_loss(time_ns)
        self._run_tasks(time_ns, first=False)

    def _overrun(self, time_ns: int) -> int:
        """Return the number of deadlines that have passed by more than half a period.

        Setpoints for the first of them would be late; with a device whose every read is slow no
        setpoint would ever be sent.
        """
        missed = max(
            0, (self._clock.now_ns() - time_ns + self.period_ns // 2 - 1) // self.period_ns
        )
        self.stats.missed += missed
        return missed

    def _run(self) -> None:
        self._prepare_thread()
        deadline_ns = self._clock.now_ns() + self.period_ns
        while not self._stop.is_set():
            self._clock.sleep_until_ns(deadline_ns)
            deadline_ns = self.period(deadline_ns)
        self._due_ns = 0

    def _age_ns(self) -> int:
        began_ns = self._began_ns
        return MonotonicClock.now_ns() - began_ns if began_ns else 0

    def _hang(self, reason: str) -> None:
        """Fail running motion, reject commands and stop the axes. Watchdog thread."""
        self._connection.abandon(reason)
        self._mixer.device_lost(reason)
        try:
            self._driver.stop(range(self._image.axes))
        except RobotdError as error:
            log.error("stopping the axes failed", reason=str(error))

    def _prepare_thread(self) -> None:
        sys.setswitchinterval(SWITCH_INTERVAL_S)
        ctypes.CDLL(None).prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0)
        self.realtime = request_realtime(self._priority)

    def _read(self, time_ns: int) -> None:
        image = self._image
        image.begin_write()
        try:
            self._driver.read(image)
            image.stamp_ns = time_ns
            self._read_failure = None
        except Exception as error:
            expected = isinstance(error, RobotdError)
            if self._read_failure is None and not expected:
                log.error("reading the process image failed", reason=str(error))
                log.debug("traceback of the failed read", exc_info=error)
            self._read_failure = str(error) if expected else f"{type(error).__name__}: {error}"
        finally:
            image.end_write()

    def _is_fresh(self, time_ns: int) -> bool:
        """Check the age of the values; stale values make the connection not ready."""
        if self._communicating_since_ns == 0:
            self._communicating_since_ns = time_ns
        age_ns = time_ns - max(self._image.fresh_ns, self._communicating_since_ns)
        stale = age_ns > self._stale_after_ns
        if stale:
            reason = self._read_failure or f"the fieldbus values are {age_ns / 1e6:.0f} ms old"
            self._connection.set_stale(True, reason)
            self._lose(self._read_failure, reason)
        else:
            self._connection.set_stale(False)
            self._lost = None
        return not stale

    def _lose(self, why: object, reason: str) -> None:
        """Fail all motion. The device's fault is read once for each ``why``."""
        if self._lost is None or self._lost[0] != why:
            fault = self._connection.fault
            self._lost = why, reason if fault in reason else f"{reason}: {fault}"
        self._mixer.device_lost(self._lost[1])

    def _report_loss(self, time_ns: int) -> None:
        """Log once when the device is lost, and once when it is back."""
        if self._connection.ready:
            if self._lost_ns:
                lost_s = (time_ns - self._lost_ns) / NANOSECONDS
                on = int(self._image.servo_on.sum())
                log.info("device is back", after_s=round(lost_s, 1), servos_on=on)
            self._lost_ns = 0
        elif self._connection.established and not self._lost_ns:
            self._lost_ns = time_ns
            reason = self._lost[1] if self._lost else self._connection.fault
            log.error("device lost", reason=reason)

    def _run_tasks(self, time_ns: int, *, first: bool) -> None:
        slack_ns = self.period_ns // 2
        for periodic in self._tasks:
            if periodic.first is not first or time_ns + slack_ns < periodic.due_ns:
                continue
            behind = time_ns - periodic.due_ns > periodic.period_ns
            periodic.due_ns = (time_ns if behind else periodic.due_ns) + periodic.period_ns
            try:
                periodic.task(self._image)
                periodic.failing = False
            except Exception:
                if not periodic.failing:
                    log.exception("a control-loop task failed", task=periodic.name)
                periodic.failing = True
