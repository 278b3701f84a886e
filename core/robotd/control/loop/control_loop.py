"""Control loop: one named thread with absolute deadlines.

Each period: read the process image → check its age → advance setpoint sources → call the
tasks that are due → sleep to the next deadline. A deadline that is missed is
counted and skipped, never made up for in a burst.
"""

from __future__ import annotations

import ctypes
import sys
import threading
from collections.abc import Callable, Sequence

from robotd.clock import NANOSECONDS, Clock, MonotonicClock
from robotd.clock.simulated import PacedClock, SteppedClock
from robotd.control.loop.period_timing import PeriodDeadlines, PeriodicTasks, Task
from robotd.control.loop.setpoint_mixer import NOT_RUNNING, SetpointMixer
from robotd.control.loop.watchdog import SIMULATED_HANG_TIMEOUT_S, Watchdog, place_of
from robotd.device.connection import Connection
from robotd.device.drivers import AxisDriver
from robotd.device.process_image import ProcessImage
from robotd.device.state import COMMUNICATES
from robotd.errors import RobotdError
from robotd.log import get_logger
from robotd.realtime import control_loop_thread, request_realtime

log = get_logger("control")

PR_SET_TIMERSLACK = 29  # linux/prctl.h
STOP_TIMEOUT_S = 2.0  # time-out for the current period; a thread that hangs is abandoned
SWITCH_PERIODS = 0.1  # longest wait for a Python thread that holds the interpreter, in periods
SWITCH_LIMITS_S = (1e-4, 1e-3)  # each wait of that length costs a context switch


class DeviceLoss:
    """Loss of the device as the control loop sees it. Control-loop thread."""

    def __init__(self, connection: Connection, image: ProcessImage) -> None:
        self._connection, self._image = connection, image
        self._found: tuple[object, str] | None = None  # key and text of the reason
        self._since_ns = 0  # 0: it is not lost
        self._established = False  # in the period before

    def find(self, key: object, reason: str) -> str:
        """Return ``reason`` with the device's fault, which is read once for each ``key``."""
        if self._found is None or self._found[0] != key:
            fault = self._connection.fault
            self._found = key, reason if fault in reason else f"{reason}: {fault}"
        return self._found[1]

    def end(self) -> None:
        """Note that the values are fresh again."""
        self._found = None

    def report(self, time_ns: int) -> None:
        """Log once when the device is lost, and once when it is back.

        In the period in which a worker establishes the connection it may not be ready yet.
        """
        before, self._established = self._established, self._connection.established
        if self._connection.ready:
            if self._since_ns:
                lost_s = (time_ns - self._since_ns) / NANOSECONDS
                on = int(self._image.servo_on.sum())
                log.info("device is back", after_s=round(lost_s, 1), servos_on=on)
            self._since_ns = 0
        elif before and self._established and not self._since_ns:
            self._since_ns = time_ns
            reason = self._found[1] if self._found else self._connection.fault
            log.error("device lost", reason=reason or "the device names none")


class ControlLoop:
    """Fixed-rate thread ``robotd-control``; only it calls ``AxisDriver.read`` and ``stream``.

    Args:
        request_stop: starts a controlled stop of axes soon, and never blocks.
        realtime_priority: SCHED_FIFO priority to ask for, 1..99; 0 asks for none.
        clock: time base of the deadlines. On a ``SteppedClock`` there is no thread: periods
            run in the thread that sleeps on the clock.

    Attributes:
        realtime: SCHED_FIFO was granted.
        stats: of the timing; any thread may call ``report``.
    """

    def __init__(
        self,
        driver: AxisDriver,
        connection: Connection,
        image: ProcessImage,
        mixer: SetpointMixer,
        request_stop: Callable[[Sequence[int]], None],
        *,
        realtime_priority: int = 0,
        clock: Clock | None = None,
    ) -> None:
        self.period_ns = mixer.period_ns
        self.realtime = False
        clock = clock or MonotonicClock()
        self._simulated = isinstance(clock, PacedClock)
        self._clock: Clock = clock.leader if isinstance(clock, PacedClock) else clock
        self._driver, self._connection, self._request_stop = driver, connection, request_stop
        self._image, self._mixer, self.stats = image, mixer, mixer.stats
        stale_after_s = connection.settings.stale_after_s
        self._stale_after_ns = round(stale_after_s * NANOSECONDS)
        self._read_failure: str | None = None  # reason of the last read; None: it succeeded
        self._since_ns = 0  # first read of this communication
        self._begun = 0  # number of this communication
        self._tasks = PeriodicTasks(self.period_ns, image)
        self._loss = DeviceLoss(connection, image)
        self._deadlines = PeriodDeadlines(
            self._clock,
            self.period_ns,
            mixer.stats,
            skips_start=not mixer.extrapolates,
            imminent=not self._simulated,
        )
        self._realtime_priority = realtime_priority
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self._began_ns = 0  # of the work, in real time: simulated time stops while a driver hangs
        limit_s = SIMULATED_HANG_TIMEOUT_S if self._simulated else stale_after_s
        self._watchdog = Watchdog(self.work_ns, lambda: place_of(self._thread), limit_s, self._hang)
        self._failing = False
        self._observer: Callable[[], None] | None = None

    @property
    def started_ns(self) -> int:
        """Start of the current period on the loop's clock: the stamp of its topics."""
        return self._deadlines.start_ns

    @property
    def is_started(self) -> bool:
        """The thread is meant to run: from ``start`` to ``stop``. False on a ``SteppedClock``."""
        return self._thread is not None and not self._stopping.is_set()

    def every(self, rate_hz: float, name: str, task: Task, *, first: bool = False) -> None:
        """Call ``task(image)`` in the control-loop thread, at most ``rate_hz`` times a second.

        Only while the device communicates. A task must not block; an exception is logged
        once and does not stop the loop. Any thread may call, also while the loop runs.

        Args:
            rate_hz: on the clock of the control loop.
            first: before the image is read, also while the device does not communicate.
        """
        self._tasks.add(rate_hz, name, task, first=first)

    def observe(self, observer: Callable[[], None]) -> None:
        """Call ``observer`` after each period, whatever the state; one at most. Before ``start``.

        It belongs to the control loop and must not block; when it raises it is not called again.
        """
        self._observer = observer

    def delay(self, seconds: float) -> None:
        """Prolong the current period by ``seconds``; for tasks that inject faults."""
        if self._simulated:
            self._began_ns = 0  # excluded from the hang detection: no driver hangs
        self._clock.sleep_until_ns(self._clock.now_ns() + round(seconds * NANOSECONDS))
        self._began_ns = MonotonicClock.now_ns()

    def work_ns(self) -> int:
        """Return the age of the current period in real time; 0: none. Any thread."""
        began_ns = self._began_ns
        return MonotonicClock.now_ns() - began_ns if began_ns else 0

    def start(self) -> None:
        """Start the loop; no effect while it runs. One thread; not again after ``stop``."""
        if isinstance(self._clock, SteppedClock):
            self._clock.attach(self.period_ns, self._stepped_period)
        elif self._thread is None:
            self._thread = threading.Thread(target=self._run, name="robotd-control", daemon=True)
            self._thread.start()
            self._watchdog.start()

    def stop(self) -> None:
        """End the thread after its period and wait; a second call has no effect."""
        if isinstance(self._clock, SteppedClock):
            self._clock.detach()
        self._stopping.set()
        self._watchdog.stop()
        if self._thread is not None:
            self._thread.join(STOP_TIMEOUT_S)
            if self._thread.is_alive():
                log.error("the control loop hangs; its thread is abandoned")
        self._deadlines.expect(0)
        self._mixer.device_lost(NOT_RUNNING)

    def period(self, deadline_ns: int) -> int:
        """Run the period of a deadline that has come; return the next deadline.

        Called in the thread of the control loop, or in the one that sleeps on a ``SteppedClock``.
        """
        deadline_ns, due = self._deadlines.begin(deadline_ns)
        if due:
            self._began_ns = MonotonicClock.now_ns()
            self.step(deadline_ns)
            self._began_ns = 0
            deadline_ns = self._deadlines.end()
            if self._observer is not None:
                self._observe(self._observer)
        self._deadlines.expect(deadline_ns)
        return deadline_ns

    def yield_to_control_loop(self) -> None:
        """Wait while a period is imminent or running, 1 ms at most. Any other thread.

        Avoids GIL convoying: threads that run many short callbacks release the GIL between two
        of them and re-acquire it before the control loop wakes. Its wait begins anew each time,
        so that it never requests the GIL after the switch interval. A burst of 50 messages
        delayed the control loop by 2 ms.
        """
        self._deadlines.wait_while_imminent()

    def step(self, time_ns: int) -> None:
        """Run the work of a period at its nominal time ``time_ns``.

        The nominal time, not the jittery real one, drives trajectories. Called by ``period``,
        or by a test that owns the clock. An exception is logged once and ends all motion,
        never the control loop.
        """
        try:
            self._tasks.run(time_ns, first=True)
            if self._communicates(time_ns):
                nominal_ns = self._read(time_ns)
                if self._is_fresh(time_ns):  # when the read began: a slow one is not a loss
                    self._mixer.advance(nominal_ns, self._image)
                self._loss.report(nominal_ns)
                self._tasks.run(nominal_ns, first=False)
            self._failing = False
        except Exception as error:
            self._mixer.device_lost(f"{type(error).__name__}: {error}")
            if not self._failing:
                log.exception("a control period failed")
                self._stop_all()
            self._failing = True

    def _run(self) -> None:
        shortest_s, longest_s = SWITCH_LIMITS_S
        interval_s = SWITCH_PERIODS * self.period_ns / NANOSECONDS
        sys.setswitchinterval(min(max(interval_s, shortest_s), longest_s))
        ctypes.CDLL(None).prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0)
        self.realtime = request_realtime(self._realtime_priority)
        deadline_ns = self._clock.now_ns() + self.period_ns
        with control_loop_thread():
            while not self._stopping.is_set():
                self._clock.sleep_until_ns(deadline_ns)
                deadline_ns = self.period(deadline_ns)

    def _stepped_period(self, deadline_ns: int) -> int:
        with control_loop_thread():
            return self.period(deadline_ns)

    def _observe(self, observer: Callable[[], None]) -> None:
        try:
            observer()
        except Exception:
            self._observer = None
            log.exception("the observer of the control loop failed")

    def _communicates(self, time_ns: int) -> bool:
        """Query the state of the device; the end of communication fails all motion."""
        state, begun = self._connection.update_ready(), self._connection.begun
        is_anew, self._begun = begun != self._begun, begun
        communicates = state in COMMUNICATES
        if not communicates:
            reason = f"communication has ended (engine state {state.value})"
        elif is_anew and self._since_ns:  # both since the last period
            reason = "communication has ended, and has begun anew"
        else:
            return True
        self._lose(reason, reason)
        if self._since_ns:  # the image holds values of the communication that has ended
            self._since_ns = 0
            self._image.forget()
            self._connection.set_stale(False)
        self._loss.report(self._deadlines.nominal(time_ns))
        return communicates

    def _read(self, time_ns: int) -> int:
        """Fill the image; return the nominal time of the period that began at ``time_ns``.

        That is fixed after the driver's ``read``, which may be slow. An exception of the driver is
        logged once.
        """
        image = self._image
        image.begin_write()
        try:
            self._driver.read(image)
            image.stamp_ns = nominal_ns = self._deadlines.nominal(time_ns)
            if image.shift_ns:
                self._deadlines.shift(image.shift_ns)
                image.shift_ns = 0
            self._read_failure = None
        except Exception as error:
            expected = isinstance(error, RobotdError)
            if self._read_failure is None and not expected:
                log.error("reading the process image failed", reason=str(error))
                log.debug("traceback of the failed read", exc_info=error)
            self._read_failure = str(error) if expected else f"{type(error).__name__}: {error}"
            nominal_ns = self._deadlines.nominal(time_ns)
        finally:
            image.end_write()
        self._since_ns = self._since_ns or nominal_ns
        return nominal_ns

    def _is_fresh(self, time_ns: int) -> bool:
        """Check the age of the values; stale values make the connection not ready."""
        age_ns = time_ns - max(self._image.fresh_ns, self._since_ns)
        if age_ns <= self._stale_after_ns:
            self._connection.set_stale(False)
            self._loss.end()
            return True
        reason = self._read_failure or f"the fieldbus values are {age_ns / 1e6:.0f} ms old"
        was_stale = self._connection.stale
        self._connection.set_stale(True, reason)
        self._lose(self._read_failure, reason)
        if not was_stale:
            self._stop_all()
        return False

    def _lose(self, key: object, reason: str) -> None:
        """Fail all motion; ``key`` identifies the reason while its text changes."""
        self._mixer.device_lost(self._loss.find(key, reason))

    def _stop_all(self) -> None:
        """Stop what got setpoints, and what the device moves by itself, seen or not."""
        self._request_stop(range(self._image.axes))

    def _hang(self, reason: str) -> None:
        """Fail running motion, reject commands and stop the axes. Watchdog thread."""
        self._connection.abandon(reason)
        self._mixer.device_lost(reason)
        self._stop_all()
