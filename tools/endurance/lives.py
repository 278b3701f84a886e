"""One life of robotd: started, brought to a phase, ended by a signal, and what was seen of it."""

from __future__ import annotations

import random
import re
import signal
import time
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from sensor_msgs.msg import JointState
from tests.ros.robot_process import Client, RobotProcess, wait_until
from tools.endurance.goals import goal_of

ORDER = ("at rest", "servos off", "communication stopped", "device closed")
TROUBLE = re.compile(r"Traceback|internal error|failed")
JOINTS = [f"joint{number}" for number in range(1, 7)]
SWING_RAD, SWING_S = 1.2, 3.0
MOVING_RAD_S = 0.1
# A start-up takes 0.7 s, a shut-down at rest 0.3 s: the moments are somewhere in them.
STARTING_S, IDLE_S, SWINGING_S, STOPPING_S = 0.8, 0.5, 1.5, 0.6
INTERPRETER = "Failed to import the site module"  # Ctrl-C before Python has begun: its status is 1
REPEATED = 130  # a second signal, or Ctrl-C before anything was served


class Phase(StrEnum):
    """When the signal comes."""

    STARTING = "start-up"
    IDLE = "idle"
    MOVING = "motion"
    STOPPING = "shut-down"


@dataclass(frozen=True)
class Life:
    """Observations of one life of a robot.

    Attributes:
        phase, number, delay_s: when and by which signal it was ended.
        status: exit status, negative for a signal.
        first_joint_state_s: from the start of the process; None when it did not live to it.
        problem: empty when all was as it should be.
    """

    phase: Phase
    number: signal.Signals
    delay_s: float
    status: int
    first_joint_state_s: float | None
    problem: str


class Lives:
    """Robots in one ROS domain, one after the other, seen by a client that stays.

    Args:
        client: stays for all of them.
        arguments: for ``robotd run``.
        robot, backend: what is run.
    """

    def __init__(
        self,
        client: Client,
        arguments: Sequence[str] = (),
        robot: str = "cr3a",
        backend: str = "sim",
    ) -> None:
        # In the background of a shell SIGINT is ignored, and so it would be by those started here.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        self._domain, self._arguments = client.domain, arguments
        self._robot, self._backend = robot, backend
        self._newest: JointState | None = None
        client.node.create_subscription(JointState, "/joint_states", self._keep, 10)

    def _keep(self, message: JointState) -> None:
        self._newest = message

    def _is_alive(self, since_ns: int) -> bool:
        """Return True if joint states have arrived that are newer than this life's start."""
        if self._newest is None:
            return False
        stamp = self._newest.header.stamp
        return bool(stamp.sec * 10**9 + stamp.nanosec > since_ns)

    def start(self) -> tuple[RobotProcess, float]:
        """Start one and wait until its joint states come: the process, and the seconds it took."""
        began_ns = time.time_ns()
        process = self.spawn()
        try:
            return process, self._first_joint_state_s(began_ns)
        except BaseException:
            process.__exit__()
            raise

    def _first_joint_state_s(self, began_ns: int) -> float:
        """Wait for joint states that were made since then; the seconds from then to now."""
        wait_until(lambda: self._is_alive(began_ns), "joint states")
        return (time.time_ns() - began_ns) * 1e-9

    def spawn(self) -> RobotProcess:
        """Start one and wait for nothing."""
        return RobotProcess(
            *self._arguments, domain=self._domain, robot=self._robot, backend=self._backend
        )

    def _last(self) -> JointState:
        assert self._newest is not None, "no joint states"
        return self._newest

    def swing(self) -> None:
        """Send the arm away from where it is, and wait until it moves."""
        client = Client(self._domain)
        try:
            target = -SWING_RAD if self._last().position[0] > 0.0 else SWING_RAD
            client.send_goal(goal_of(JOINTS, [(SWING_S, [target] * len(JOINTS))]))
            wait_until(lambda: abs(self._last().velocity[0]) > MOVING_RAD_S, "motion")
        finally:
            client.close()

    def live(self, phase: Phase, number: signal.Signals, chance: random.Random) -> Life:
        """One life, from start to end; what does not happen in time is a problem, too."""
        began_ns = time.time_ns()
        with self.spawn() as process:
            try:
                seconds, longest_s = self._bring_to(phase, process, began_ns)
                delay_s = round(chance.uniform(0.0, longest_s), 3)
                time.sleep(delay_s)
                status = process.end(number)
            except AssertionError as error:
                process.process.kill()
                return Life(phase, number, 0.0, 0, None, f"{error}; {process.output[-300:]}")
            problem = problem_of(phase, number, status, process.output)
        return Life(phase, number, delay_s, status, seconds, problem)

    def _bring_to(
        self, phase: Phase, process: RobotProcess, began_ns: int
    ) -> tuple[float | None, float]:
        """Seconds to the first joint state, and the longest that the signal may wait now."""
        if phase is Phase.STARTING:
            return None, STARTING_S
        seconds = self._first_joint_state_s(began_ns)
        process.wait_ready()
        if phase is Phase.IDLE:
            return seconds, IDLE_S
        self.swing()
        if phase is Phase.MOVING:
            return seconds, SWINGING_S
        process.process.send_signal(signal.SIGTERM)
        return seconds, STOPPING_S


def problem_of(phase: Phase, number: signal.Signals, status: int, output: str) -> str:
    """Return the problems of an end; empty without any."""
    if phase is Phase.STARTING and INTERPRETER in output:
        return ""
    if status not in _allowed(phase, number):
        return f"status {status}: {output[-300:]}"
    if number is signal.SIGKILL or status == REPEATED:
        return ""
    if status < 0:  # before robotd listened to signals
        return "ended by the signal with the device open" if "device open" in output else ""
    if trouble := TROUBLE.search(output):
        return f"{trouble.group()} in the log: {output[-300:]}"
    return _disorder(output, is_enabled="servos on" in output)


def _allowed(phase: Phase, number: signal.Signals) -> set[int]:
    if number is signal.SIGKILL:
        return {-number, 0} if phase is Phase.STOPPING else {-number}
    if phase is Phase.STARTING:
        return {0, REPEATED, -number}
    return {0, REPEATED} if phase is Phase.STOPPING else {0}


def _disorder(output: str, *, is_enabled: bool) -> str:
    """Return the steps of a shut-down that are missing or out of order."""
    found = [output.find(step) for step in ORDER]
    needed = ORDER if is_enabled else ORDER[2:] if "communication started" in output else ()
    missing = [step for step, place in zip(ORDER, found, strict=True) if place < 0]
    if absent := [step for step in needed if step in missing]:
        return f"not in the log: {', '.join(absent)}"
    places = [place for place in found if place >= 0]
    return "" if places == sorted(places) else f"steps out of order: {found}"
