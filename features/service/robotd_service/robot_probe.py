"""Health of a robot for a supervisor: life of its control loop, readiness for motion."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass

from robotd.api import NANOSECONDS
from robotd.api.features import identity
from robotd.api.robots import Robot, SimulatedClock

LOOP_TIMEOUT_S = 3.0  # the loop's own watchdog stops the axes after 1 s; a busy computer needs less


@dataclass(frozen=True)
class ProbedHealth:
    """Health of a robot at one moment.

    Attributes:
        alive: the control loop runs, or is not meant to: before the start, and at the end.
        ready: alive, and nothing keeps the axes from moving.
        state: one line: what hangs, the first problem, or "ready".
        problems: all that keeps axes from moving, the root cause first.
    """

    alive: bool
    ready: bool
    state: str
    problems: tuple[str, ...]


class RobotProbe:
    """Evaluates a robot's health. Any thread.

    Args:
        robot: may be started or not.
    """

    def __init__(self, robot: Robot, namespace: str) -> None:
        self._robot = robot
        self._identity = identity(robot, namespace)
        self._began_s = time.monotonic()
        self._period = (0, self._began_s)  # start of the newest period seen, and when it was seen

    def look(self) -> ProbedHealth:
        """Return the health now."""
        robot = self._robot
        if hang := self._hang():
            return ProbedHealth(alive=False, ready=False, state=hang, problems=(hang,))
        problems = tuple(robot.problems)
        ready = robot.connection.ready and not problems
        if ready:
            state = "ready"
        elif step := robot.connection.step.text:  # of a start-up: its problems are no news
            state = step
        else:
            state = problems[0] if problems else f"the device is {robot.connection.state.value}"
        return ProbedHealth(alive=True, ready=ready, state=state, problems=problems)

    def document(self) -> dict[str, object]:
        """Return the health with the robot's identity, for programs."""
        stats = self._robot.control_loop.stats
        return {
            **self._identity,
            **asdict(self.look()),
            "uptime_s": round(time.monotonic() - self._began_s, 1),
            "periods": stats.cycles,
            "missed_deadlines": stats.missed,
        }

    def _hang(self) -> str:
        """Return why the control loop is not alive; "" while it is."""
        loop, now_s = self._robot.control_loop, time.monotonic()
        work_s = loop.work_ns() / NANOSECONDS
        if work_s > LOOP_TIMEOUT_S:
            return f"the control loop hangs: a period takes {work_s:.1f} s"
        # Simulated time may stand still.
        if not loop.is_started or isinstance(self._robot.clock, SimulatedClock):
            self._period = (0, now_s)
            return ""
        start_ns = loop.started_ns
        if start_ns != self._period[0]:
            self._period = (start_ns, now_s)
        idle_s = now_s - self._period[1]
        if idle_s > LOOP_TIMEOUT_S:
            return f"the control loop has begun no period for {idle_s:.1f} s"
        return ""
