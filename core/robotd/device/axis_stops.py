"""Stops of axes, repeated until the image shows that the axes are at rest."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from queue import Empty, SimpleQueue

from robotd.clock import NANOSECONDS, Clock
from robotd.device.drivers import AxisDriver
from robotd.device.process_image import ProcessImage
from robotd.device.state import Operation
from robotd.errors import AbandonedCall, RobotdError
from robotd.log import get_logger

log = get_logger("stop")

FIRST_RETRY_S, LAST_RETRY_S = 0.05, 1.0  # after a call that failed; each time twice as long
ABANDONED_RETRY_S = 10.0  # each call that does not return keeps a thread
QUICK_AFTER = 3  # calls that failed or had no effect
POLL_INTERVAL_S = 0.02  # of the thread while a stop is not confirmed
SLOWER = 0.9  # ratio of speeds that counts as slowing down


@dataclass
class _Stop:
    """Stop of one axis that is not confirmed yet; times on the robot's clock.

    Attributes:
        begun_ns: time of the request.
        moved: the axis was not idle then.
        slowed_ns, speed: time at which it was last seen slower than before, and that speed.
        trajectory_s: duration for ``AxisDriver.stop_trajectory``; NaN: another stop.
        due_ns: time of the next call.
        done_ns: return of the last call, if it succeeded; 0: it did not.
        calls, vain: number of calls, and of ineffective ones: they failed, or had no effect.
        failure: reason of the last call that failed.
        quick: it is a quick stop.
    """

    begun_ns: int
    moved: bool
    slowed_ns: int
    speed: float = math.inf
    trajectory_s: float = math.nan
    due_ns: int = 0
    done_ns: int = 0
    calls: int = 0
    vain: int = 0
    failure: str = ""
    quick: bool = False

    @property
    def kind(self) -> tuple[bool, float]:
        """Equal for stops that one call makes."""
        return self.quick, -1.0 if math.isnan(self.trajectory_s) else self.trajectory_s


class AxisStops:
    """Stops axes until the image shows them idle, for any client; any thread may ask.

    A call that fails, or has no effect, is repeated, more and more seldom, and becomes a quick stop
    after ``QUICK_AFTER`` of them, or when an axis has not slowed down for ``ramp_s``. The thread
    ``robotd-axis-stops`` makes the calls, so that the control loop never waits for a driver. Before
    ``start``, as in simulated time, the thread that asks makes them, and the control loop repeats.

    Args:
        communicates: the device can be reached; without that no call is made.
        names: of the axes, for texts.
        clock: of the image.
        shown_s: after which the image shows what a driver has accepted.
        ramp_s: time in which a controlled stop has to show.

    Attributes:
        counts: number of requests for each axis so far.
    """

    def __init__(
        self,
        driver: AxisDriver,
        image: ProcessImage,
        communicates: Callable[[], bool],
        names: Sequence[str],
        clock: Clock,
        shown_s: float,
        ramp_s: float,
    ) -> None:
        self.counts = [0] * len(names)
        self._driver, self._image, self._communicates = driver, image, communicates
        self._names, self._clock = names, clock
        self._shown_ns, self._ramp_ns = round(shown_s * NANOSECONDS), round(ramp_s * NANOSECONDS)
        self._read_only = bool(driver.read_only)
        self._stops: dict[int, _Stop] = {}
        self._lock = threading.Lock()  # of ``_stops``; never held during a driver's call
        self._wake: SimpleQueue[None] = SimpleQueue()  # its ``put`` never waits
        self._closing = False
        self._thread: threading.Thread | None = None

    def request(self, axes: Sequence[int], trajectory_s: float = math.nan) -> None:
        """Stop ``axes`` soon; those that are being stopped, and read-only ones: no effect.

        Never blocks, never raises.

        ``trajectory_s``: stop a trajectory of exactly these axes in this time; NaN: any motion.
        """
        if self._read_only:
            return
        with self._lock:
            new = [axis for axis in axes if axis not in self._stops]
            for axis in new:
                self._add(axis, trajectory_s)
        if self._thread is None:
            self._work()
        elif new:
            self._wake.put(None)

    def call(self, axes: Sequence[int], *, quick: bool = False) -> None:
        """Stop ``axes`` now, or quick-stop them; what fails goes on in the background.

        Worker. Raises RobotdError: the call failed.
        """
        with self._lock:
            for axis in axes:
                stop = self._stops.get(axis) or self._add(axis)
                self.counts[axis] += 1
                stop.quick |= quick
                stop.due_ns = self._clock.now_ns() + self._shown_ns
            stops = {axis: self._stops[axis] for axis in axes}
        try:
            (self._driver.quick_stop if quick else self._driver.stop)(axes)
        except RobotdError as error:
            self._note_failure(stops, error)
            raise
        else:
            self._note_success(stops)
        finally:
            if self._thread is not None:
                self._wake.put(None)

    @property
    def pending(self) -> bool:
        """An axis that answers is being stopped, and not confirmed to be at rest. Any thread."""
        offline = self._image.offline
        return any(not offline[axis] for axis in tuple(self._stops))

    def is_pending(self, axes: Sequence[int]) -> bool:
        """Return True while one of ``axes`` is being stopped. Any thread."""
        return any(axis in self._stops for axis in axes)

    def failure(self, axis: int) -> str:
        """Return why the stop of ``axis`` is not in force; "" without one. Any thread."""
        stop = self._stops.get(axis)
        if stop is None or (stop.done_ns and not stop.vain):
            return ""
        return f"its stop is not confirmed{f' ({stop.failure})' if stop.failure else ''}"

    def unconfirmed(self) -> Iterator[tuple[int, str]]:
        """Yield each axis whose stop has failed or had no effect, with the reason. Any thread."""
        for axis, stop in tuple(self._stops.items()):
            if stop.vain and stop.moved:
                yield axis, stop.failure or "the axis moves on"

    def supersede(self, axis: int) -> None:
        """Forget a stop of ``axis`` that the device has taken: it has accepted a new motion."""
        with self._lock:
            stop = self._stops.get(axis)
            if stop is not None and stop.done_ns and not stop.vain:
                del self._stops[axis]

    def look(self, image: ProcessImage) -> None:
        """Note which axes have come to rest; once a period. Control loop."""
        if self._stops:
            with self._lock:
                self._settle(image)
            if self._thread is None:
                self._work()

    def start(self) -> None:
        """Start the thread ``robotd-axis-stops``; no effect while it runs, or after ``close``."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="robotd-axis-stops", daemon=True)
            self._thread.start()

    def close(self, timeout_s: float) -> None:
        """End the thread; one that hangs in the driver is abandoned after ``timeout_s``."""
        self._closing = True
        thread = self._thread
        if thread is not None:
            self._wake.put(None)
            thread.join(timeout_s)
            self._thread = None

    def _add(self, axis: int, trajectory_s: float = math.nan) -> _Stop:
        """Begin a stop. Lock held."""
        self.counts[axis] += 1
        moved = bool(self._image.operation.item(axis) != Operation.IDLE)
        now_ns = self._clock.now_ns()
        stop = self._stops[axis] = _Stop(now_ns, moved, now_ns, trajectory_s=trajectory_s)
        return stop

    def _run(self) -> None:
        while not self._closing:
            with suppress(Empty):
                self._wake.get(timeout=POLL_INTERVAL_S if self._stops else None)
            if not self._closing:
                self._work()

    def _work(self) -> None:
        """Make the calls that are due."""
        if not self._stops or not self._communicates():
            return
        with self._lock:
            self._settle(self._image)
            due = self._due(self._clock.now_ns())
        # All together at first: what moves on one path has to stop on it. Then one by one, so that
        # an axis that fails does not keep the others from being stopped.
        alone = [axis for axis, stop in due.items() if stop.vain >= QUICK_AFTER]
        kinds: dict[tuple[bool, float], list[int]] = {}
        for axis, stop in due.items():
            if axis not in alone:
                kinds.setdefault(stop.kind, []).append(axis)
        for axes in [*kinds.values(), *([axis] for axis in alone)]:
            self._call({axis: due[axis] for axis in axes})

    def _due(self, now_ns: int) -> dict[int, _Stop]:
        """Return the stops that a call is due for, and put the next one off. Lock held."""
        due = {}
        for axis, stop in sorted(self._stops.items()):
            if stop.due_ns > now_ns:
                continue
            is_slow = now_ns - stop.slowed_ns > self._ramp_ns
            if stop.done_ns:
                shown = self._image.fresh_ns > stop.done_ns
                if shown and self._image.operation.item(axis) == Operation.STOPPING and not is_slow:
                    continue
                stop.vain += shown
            if not stop.quick and (stop.vain >= QUICK_AFTER or (is_slow and stop.moved)):
                stop.quick = True
                log.error("a stop has no effect: quick stop", axis=self._names[axis])
            stop.due_ns = now_ns + round(LAST_RETRY_S * NANOSECONDS)
            due[axis] = stop
        return due

    def _call(self, stops: dict[int, _Stop]) -> None:
        axes, (first, *_) = list(stops), stops.values()
        try:
            if first.quick:
                self._driver.quick_stop(axes)
            elif not math.isnan(first.trajectory_s):
                self._driver.stop_trajectory(axes, first.trajectory_s)
            else:
                self._driver.stop(axes)
        except RobotdError as error:
            self._note_failure(stops, error)
        else:
            self._note_success(stops)

    def _note_success(self, stops: dict[int, _Stop]) -> None:
        with self._lock:
            now_ns = self._clock.now_ns()
            for stop in stops.values():
                stop.done_ns, stop.failure, stop.calls = now_ns, "", stop.calls + 1
                stop.due_ns = now_ns + self._retry_ns(stop, self._shown_ns)

    def _note_failure(self, stops: dict[int, _Stop], error: RobotdError) -> None:
        """Note that a call failed; the reason is logged when it is new."""
        reason = str(error)
        with self._lock:
            known = all(stop.failure == reason for stop in stops.values())
            now_ns = self._clock.now_ns()
            for stop in stops.values():
                stop.done_ns, stop.failure = 0, reason
                stop.calls, stop.vain = stop.calls + 1, stop.vain + 1
                abandoned_ns = round(ABANDONED_RETRY_S * NANOSECONDS)
                hangs = isinstance(error, AbandonedCall)
                stop.due_ns = now_ns + (abandoned_ns if hangs else self._retry_ns(stop, 0))
        if not known:
            names = [self._names[axis] for axis in stops]
            log.error("stopping the axes failed; it is repeated", axes=names, reason=reason)

    def _retry_ns(self, stop: _Stop, least_ns: int) -> int:
        retry_s = min(FIRST_RETRY_S * 2.0 ** min(stop.calls - 1, 10), LAST_RETRY_S)
        return max(round(retry_s * NANOSECONDS), least_ns)

    def _settle(self, image: ProcessImage) -> None:
        """Forget the stops of axes that are at rest. Lock held.

        An image from before a stop proves nothing, and one that is hardly newer may not show yet
        what was moving when the stop failed. Nothing is known of an axis that does not answer.
        """
        for axis, stop in tuple(self._stops.items()):
            speed = max(abs(image.velocity[axis]), abs(image.velocity_command[axis]))
            if speed < SLOWER * stop.speed:
                stop.speed, stop.slowed_ns = float(speed), image.fresh_ns
            since_ns = stop.done_ns or stop.begun_ns + self._shown_ns
            idle = image.operation.item(axis) == Operation.IDLE or not image.servo_on[axis]
            if idle and image.fresh_ns > since_ns and not image.offline[axis]:
                del self._stops[axis]
                if stop.vain:
                    after_s = round((self._clock.now_ns() - stop.begun_ns) / NANOSECONDS, 3)
                    log.info("at rest", axis=self._names[axis], after_s=after_s)
