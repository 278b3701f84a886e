"""How a robot is, part by part, in the levels of ROS diagnostics. Imports no ROS."""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterator
from dataclasses import dataclass, field
from enum import IntEnum

from robotd.clock import NANOSECONDS
from robotd.cycle.stats import CycleReport
from robotd.device.drivers import NetworkState
from robotd.device.image import ProcessImage
from robotd.device.state import CommandMode, EngineState, Operation
from robotd.errors import RobotdError
from robotd.robot import Robot

RECENT_S = 2.0  # for how long something that happened is worth a warning
SLOW = 0.95  # part of the cycle's rate below which it is too slow
OPERATIONAL = 16
STATES = {0: "None", 1: "Init", 2: "Preop", 4: "Boot", 8: "Safeop", OPERATIONAL: "Op"}


class Level(IntEnum):
    """The numbers of diagnostic_msgs/DiagnosticStatus."""

    OK = 0  # as it should be
    WARN = 1  # works, or would, but somebody should look
    ERROR = 2  # does not work
    STALE = 3  # nothing is known now


@dataclass(frozen=True)
class Status:
    """One part of the robot: ``message`` says why it has its level, ``values`` are for people."""

    part: str
    level: Level
    message: str
    values: dict[str, str] = field(default_factory=dict)


class Health:
    """Looks at a robot; for one thread, which may wait for the fieldbus, so not the cycle's."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._cycles = Growth()
        self._missed = Growth()
        self._lost = [Growth() for _ in range(robot.fieldbus.masters)]

    def fingerprint(self) -> Hashable:
        """Another value whenever something changed that should be told at once. Cheap."""
        robot, image = self._robot, self._robot.image
        flags = (image.servo_on, image.amp_alarm, image.offline, image.alarm_code,
                 image.negative_limit, image.positive_limit, image.mode)  # fmt: skip
        gripper = robot.gripper is not None and robot.gripper.is_commanded_closed
        states = (robot.engine.state, robot.engine.ready, gripper)
        return (*states, *(array.tobytes() for array in flags))

    def statuses(self) -> list[Status]:
        """Of the engine, each axis, each fieldbus, the cycle, and the gripper."""
        robot = self._robot
        state, now_ns = robot.engine.state, robot.clock.now_ns()
        found = [engine_status(state, robot.backend.name, ready=robot.engine.ready)]
        image = robot.image.copy()
        used = {*robot.joint_axes, *robot.wheel_axes}
        for axis, name in enumerate(robot.axes.names):
            found.append(axis_status(name, axis, image, state, used=axis in used))
        found += [self._fieldbus(master, state, now_ns) for master in range(len(self._lost))]
        found.append(self._cycle(now_ns))
        if robot.gripper is not None:
            found.append(gripper_status(state, closed=robot.gripper.is_commanded_closed))
        return found

    def _fieldbus(self, master: int, state: EngineState, now_ns: int) -> Status:
        part = "fieldbus" if len(self._lost) == 1 else f"fieldbus {master}"
        if state is not EngineState.COMMUNICATING:
            return _unknown(part, state)
        try:
            network = self._robot.fieldbus.network_state(master)
        except RobotdError as error:
            return Status(part, Level.ERROR, str(error))
        losing = self._lost[master].is_recent(network.packet_loss, now_ns)
        return fieldbus_status(part, network, losing=losing)

    def _cycle(self, now_ns: int) -> Status:
        cycle, settings = self._robot.cycle, self._robot.descriptor.cycle
        report = cycle.stats.report()
        granted = f"SCHED_FIFO {settings.realtime_priority}" if cycle.realtime else "none"
        return cycle_status(
            report,
            settings.rate_hz,
            granted,
            running=self._cycles.is_recent(report.cycles, now_ns),
            missing=self._missed.is_recent(report.missed, now_ns),
        )


class Growth:
    """Notices that a counter has grown lately. One that is reset begins anew."""

    def __init__(self) -> None:
        self._count = 0
        self._grown_ns: int | None = None

    def is_recent(self, count: int, now_ns: int) -> bool:
        """Whether ``count`` was seen to grow in the last ``RECENT_S``."""
        if count > self._count:
            self._grown_ns = now_ns
        self._count = count
        return self._grown_ns is not None and now_ns - self._grown_ns < RECENT_S * NANOSECONDS


def engine_status(state: EngineState, backend: str, *, ready: bool) -> Status:
    """OK while axes can be commanded, ERROR when what is known is too old, else WARN."""
    values = {"state": state.value, "ready": _yes_no(ready), "backend": backend}
    if state is EngineState.UNKNOWN:
        return Status("engine", Level.ERROR, "the device gives no fresh values", values)
    if ready:
        return Status("engine", Level.OK, state.value, values)
    return Status("engine", Level.WARN, f"{state.value}: axes cannot be commanded", values)


def axis_status(
    part: str, axis: int, image: ProcessImage, state: EngineState, *, used: bool
) -> Status:
    """One axis; that a servo is off is worth a warning where the robot switches it on itself."""
    if state is not EngineState.COMMUNICATING:
        return _unknown(part, state)
    level, message = _judge_axis(axis, image, used=used)
    error = image.position_command[axis] - image.position[axis]
    values = {
        "axis": str(axis),
        "servo": "on" if image.servo_on[axis] else "off",
        "alarm code": str(image.alarm_code[axis]),
        "mode": CommandMode(image.mode[axis]).name.lower(),
        "operation": Operation(image.operation[axis]).name.lower(),
        "position (rad or m)": _number(image.position[axis]),
        "velocity (rad/s or m/s)": _number(image.velocity[axis]),
        "torque (N·m or N)": _number(image.torque[axis]),
        "following error (rad or m)": _number(error),
    }
    if image.mode[axis] != CommandMode.POSITION:
        del values["following error (rad or m)"]
    return Status(part, level, message, values)


def fieldbus_status(part: str, network: NetworkState, *, losing: bool) -> Status:
    """A master and its slaves: ERROR for one that is lost, WARN for one that is not in Op."""
    errors = [
        f"slave {slave.id} {'is offline' if slave.offline else f'has AL code {slave.al_code:#06x}'}"
        for slave in network.slaves
        if slave.offline or slave.al_code
    ]
    warnings = [
        f"slave {slave.id} is in {STATES.get(slave.state, slave.state)}"
        for slave in network.slaves
        if slave.state != OPERATIONAL and not slave.offline
    ]
    if losing:
        warnings.append("packets are being lost")
    level = Level.ERROR if errors else Level.WARN if warnings else Level.OK
    message = "; ".join([*errors, *warnings]) or f"{len(network.slaves)} slaves in Op"
    values = {
        "master state": STATES.get(network.state, str(network.state)),
        "period (µs)": str(network.comm_period_us),
        "packet loss": str(network.packet_loss),
        "packet timeout": str(network.packet_timeout),
        "over cycle": str(network.over_cycle),
    }
    return Status(part, level, message, values)


def cycle_status(
    report: CycleReport, rate_hz: float, realtime: str, *, running: bool, missing: bool
) -> Status:
    """The cycle: ERROR when it stands, WARN while deadlines are missed or it is too slow.

    Args:
        rate_hz: what it should run at.
        realtime: the scheduling that was granted, for people.
        running, missing: whether it ran, and missed deadlines, lately.
    """
    values = {
        "rate (Hz)": f"{report.rate_hz:.1f}",
        "wanted rate (Hz)": f"{rate_hz:g}",
        "lateness p50 (µs)": f"{report.lateness_p50_us:.0f}",
        "lateness p99 (µs)": f"{report.lateness_p99_us:.0f}",
        "lateness max (µs)": f"{report.lateness_max_us:.0f}",
        "execution p99 (µs)": f"{report.execution_p99_us:.0f}",
        "periods": str(report.cycles),
        "missed deadlines": str(report.missed),
        "real-time priority": realtime,
    }
    if report.cycles == 0:
        return Status("cycle", Level.STALE, "not started", values)
    if not running:
        return Status("cycle", Level.ERROR, "stands still", values)
    if missing:
        return Status("cycle", Level.WARN, "deadlines are being missed", values)
    if report.rate_hz < SLOW * rate_hz:
        message = f"{report.rate_hz:.0f} Hz instead of {rate_hz:g} Hz"
        return Status("cycle", Level.WARN, message, values)
    return Status("cycle", Level.OK, f"{rate_hz:g} Hz", values)


def gripper_status(state: EngineState, *, closed: bool) -> Status:
    """Where the gripper was sent; nothing measures whether it is there."""
    if state is not EngineState.COMMUNICATING:
        return _unknown("gripper", state)
    return Status("gripper", Level.OK, "commanded closed" if closed else "commanded open")


def _judge_axis(axis: int, image: ProcessImage, *, used: bool) -> tuple[Level, str]:
    return next(_complaints(axis, image, used=used), (Level.OK, _servo(axis, image)))


def _complaints(axis: int, image: ProcessImage, *, used: bool) -> Iterator[tuple[Level, str]]:
    """What is wrong with an axis, the worst first."""
    if image.offline[axis]:
        yield Level.ERROR, "the drive does not answer"
    if image.amp_alarm[axis]:
        yield Level.ERROR, f"amplifier alarm {image.alarm_code[axis]}"
    if image.negative_limit[axis]:
        yield Level.WARN, "on the negative limit switch"
    if image.positive_limit[axis]:
        yield Level.WARN, "on the positive limit switch"
    if used and not image.servo_on[axis]:
        yield Level.WARN, "servo off"


def _servo(axis: int, image: ProcessImage) -> str:
    return "servo on" if image.servo_on[axis] else "servo off"


def _unknown(part: str, state: EngineState) -> Status:
    return Status(part, Level.STALE, f"not known: engine is {state.value}")


def _yes_no(value: bool) -> str:
    return "yes" if value else "no"


def _number(value: float) -> str:
    return "not known" if math.isnan(value) else f"{value:.6g}"
