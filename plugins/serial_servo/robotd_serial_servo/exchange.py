"""The thread that owns the bus: an exchange with all servos each period, commands between."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from robotd.api import (
    NANOSECONDS,
    BoolArray,
    Clock,
    DeviceTimeout,
    FloatArray,
    IntArray,
    NotReady,
    RobotdError,
    get_logger,
    request_realtime,
)
from robotd_serial_servo.calibration import RAD_PER_TICK
from robotd_serial_servo.options import PlannedServo
from robotd_serial_servo.serial_port import PortLost
from robotd_serial_servo.servo_bus import BusError, ServoBus
from robotd_serial_servo.servo_record import ServoRecord
from robotd_serial_servo.switching import Steps, release

SEARCH_PERIODS = 20  # between two questions to a servo that is offline
JOIN_S = 3.0
log = get_logger("serial_servo")


@dataclass(frozen=True, eq=False)
class Feedback:
    """Values of one exchange, arrays of shape (n_axes,) in SI units.

    Attributes:
        time_ns: when the newest were asked for; 0 before any.
        ended_ns: when the exchange was over; 0 before any.
        goal: that the servo has, as far as is known; NaN while it takes none.
        silent: the last request had no reply, and the servo is not offline yet.
        activation: of each servo, 0 while it takes no goals.
    """

    time_ns: int
    ended_ns: int
    position: FloatArray
    velocity: FloatArray
    goal: FloatArray
    torque: BoolArray
    silent: BoolArray
    offline: BoolArray
    alarm: IntArray
    activation: IntArray


class Job:
    """A command that the bus thread executes step by step, awaited by one worker.

    ``urgent``: before others, and whatever time it takes.
    """

    def __init__(self, steps: Steps, *, urgent: bool) -> None:
        self.steps, self.urgent, self.done = steps, urgent, threading.Event()
        self.error: Exception | None = None

    def step(self) -> bool:
        """Execute one step; True: it was the last. PortLost ends it, too, and is raised."""
        try:
            next(self.steps)
        except StopIteration:
            self.done.set()
        except PortLost as error:
            self.end(error)
            raise
        except Exception as error:  # noqa: BLE001 - belongs to the caller
            self.end(error)
        return self.done.is_set()

    def end(self, error: Exception) -> None:
        """End it with an error. What it does at its end may fail: the port may be lost."""
        self.error = error
        with suppress(RobotdError):
            self.steps.close()
        self.done.set()


class Exchange:
    """Cyclic exchange with the servos of one bus, in a thread of its own.

    Any thread may call the methods, the control loop only ``send`` and the attributes.

    Args:
        period_s: of the exchange.
        priority: SCHED_FIFO of the thread, where the system grants it; 0: none.

    Attributes:
        feedback: of the last exchange, replaced as a whole.
        failure: why the port is lost; "" while it is there.
        let_go: axes that a hand guides, with the job that holds each again (None: nothing yet);
            of the driver of the axes. It ends with communication.
        late, longest_s: exchanges that began more than half a period late, and the longest one.
    """

    def __init__(
        self,
        bus: ServoBus,
        servos: Sequence[PlannedServo],
        clock: Clock,
        period_s: float,
        lost_after_s: float,
        priority: int,
    ) -> None:
        self.bus, self.failure = bus, ""
        self.records = [ServoRecord(plan) for plan in servos]
        self.let_go: dict[int, Job | None] = {}
        self.late, self.longest_s = 0, 0.0
        self._clock, self._lost_after_s, self._priority = clock, lost_after_s, priority
        self._period_ns = round(period_s * NANOSECONDS)
        count = len(self.records)
        # Targets, and the activations that they are for: replaced together.
        self._targets: tuple[FloatArray, IntArray] = np.full(count, np.nan), np.zeros(count, int)
        self._jobs: list[Job] = []
        self._lock = threading.Lock()  # of the jobs
        self._ends = False
        self._round = 0
        self.feedback = self._summary(0)
        self._thread = threading.Thread(target=self._run, name="serial-servo-bus", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """End the thread and close the port."""
        self._ends = True
        if self._thread.is_alive():
            self._thread.join(JOIN_S)
        self.bus.close()

    def send(self, targets: FloatArray, activations: IntArray) -> None:
        """Take targets (n_axes,) in rad for the next exchange; NaN: none. Control-loop thread.

        Args:
            activations: as they were shown when the targets were computed: what was computed before
                a servo went off is not sent after it has come on again.
        """
        self._targets = targets.copy(), activations

    def switch_off(self, axis: int) -> Job:
        """Begin to switch a servo off, before anything else is done; goals end."""
        record = self.records[axis]
        record.releases += 1
        return self.submit(release(self.bus, record), urgent=True)

    def submit(self, steps: Steps, *, urgent: bool = False) -> Job:
        """Let the bus thread execute ``steps``. Raises NotReady: there is no bus."""
        job = Job(steps, urgent=urgent)
        with self._lock:
            if self.failure or self._ends:
                raise NotReady(self.failure or "the bus is closed")
            self._jobs.append(job)
        return job

    def wait(self, job: Job, timeout_s: float) -> None:
        """Wait for a job. Raises its error, or DeviceTimeout.

        It ends with the time, unless it is urgent: what is to go off goes off later, too.
        """
        if not job.done.wait(timeout_s):
            with self._lock:
                if job in self._jobs and not job.urgent:
                    self._jobs.remove(job)
            raise DeviceTimeout(f"the bus did not get to it within {timeout_s:g} s")
        if isinstance(job.error, BusError | PortLost):
            raise NotReady(str(job.error)) from job.error
        if job.error is not None:
            raise job.error

    def _run(self) -> None:
        request_realtime(self._priority)
        clock, due_ns = self._clock, self._clock.now_ns()
        try:
            while not self._ends:
                self._exchange()
                due_ns += self._period_ns
                self._work(due_ns)
                now_ns = clock.now_ns()
                if now_ns - due_ns > self._period_ns // 2:
                    self.late, due_ns = self.late + 1, now_ns
                clock.sleep_until_ns(due_ns)
            self._end_jobs("the bus is closed")  # what they do at their end needs the port
        except RobotdError as error:
            self._fail(str(error))
        except Exception as error:  # noqa: BLE001 - the thread ends, which must not look alive
            log.error("the bus thread has failed", reason=repr(error))
            self._fail(f"bus thread: {error!r}")

    def _fail(self, reason: str) -> None:
        self.failure = reason
        self._end_jobs(reason)

    def _end_jobs(self, reason: str) -> None:
        with self._lock:
            jobs, self._jobs = self._jobs, []
        for job in jobs:
            if not job.done.is_set():
                job.end(NotReady(reason))

    def _exchange(self) -> None:
        """Read all servos, judge what they show, then send goals to those that are on.

        In this order, because a goal switches some servos on: a servo gets one only if it has just
        shown that it is on, and that it has the goal before.
        """
        began_ns, targets = self._clock.now_ns(), self._targets
        self._round += 1
        states = dict(
            self.bus.read([record.servo for record in self.records if not record.offline])
        )
        absent = [record.servo for record in self.records if record.offline]
        if absent and self._round % SEARCH_PERIODS == 0:
            # All by turns with one alone: after one that is missing, those of a sync read may wait
            # for it, yet after a loss of the supply all are back, and an arm is to be so at once.
            turn, one = divmod(self._round // SEARCH_PERIODS, 2)
            states |= self.bus.read([absent[turn % len(absent)]] if one else absent)
        now_ns = self._clock.now_ns()
        for axis, record in enumerate(self.records):
            state, alarm = states.get(record.servo), record.alarm
            if state is None:
                record.miss(now_ns, self._lost_after_s)
            elif record.take(state, now_ns, self._lost_after_s):
                self.switch_off(axis)
            elif record.off_pending and not record.missed:
                record.off_pending = False  # until it fails again
                self.switch_off(axis)
            if record.alarm != alarm:
                log.warning("servo alarm", servo=record.servo, code=hex(record.alarm))
        # Those from before the replies, however late these are: one more of each exchange.
        self._send_goals(*targets)
        ended_ns = self._clock.now_ns()
        self.longest_s = max(self.longest_s, (ended_ns - began_ns) / NANOSECONDS)
        self.feedback = self._summary(ended_ns)

    def _send_goals(self, targets: FloatArray, meant: IntArray) -> None:
        goals, period_s = {}, self._period_ns / NANOSECONDS
        for axis, record in enumerate(self.records):
            fits = record.activation and meant[axis] == record.activation
            goal = record.next_goal(float(targets[axis]) if fits else np.nan, period_s)
            if goal is not None:
                goals[record.servo] = goal
        if goals:
            self.bus.write_goals(goals)

    def _summary(self, ended_ns: int) -> Feedback:
        records, states = self.records, [record.state for record in self.records]
        angles, speeds, goals = np.full((3, len(records)), np.nan)
        on = np.zeros(len(records), bool)
        for axis, (record, state) in enumerate(zip(records, states, strict=True)):
            if state is not None:
                scale = record.plan.scale
                angles[axis] = scale.angle(state.position)
                speeds[axis] = scale.polarity * RAD_PER_TICK * state.velocity
                if record.goal is not None:
                    goals[axis] = scale.angle(record.goal)
                on[axis] = state.torque and not (record.switching or record.offline)
        offline = [record.offline or record.state is None for record in records]
        silent = [
            not record.offline and (record.missed or record.goal_lost_ns > 0) for record in records
        ]
        return Feedback(
            max((state.time_ns for state in states if state), default=0),
            ended_ns,
            angles,
            speeds,
            goals,
            on,
            np.array(silent),
            np.array(offline),
            np.array([record.alarm for record in records], np.int64),
            np.array([record.activation for record in records], np.int64),
        )

    def _work(self, due_ns: int) -> None:
        """Execute a step of each job: of the urgent ones, and of others until ``due_ns``."""
        for number, job in enumerate(sorted(self._jobs, key=lambda job: not job.urgent)):
            if number and not job.urgent and self._clock.now_ns() > due_ns:
                break
            ended = job.step()
            with self._lock:  # the next one has its turn first
                if job in self._jobs:
                    self._jobs.remove(job)
                    self._jobs += [] if ended else [job]
