"""Health of a robot, part by part, and detection of changes."""

from __future__ import annotations

from collections.abc import Hashable

from robotd.clock import NANOSECONDS
from robotd.device.state import ConnectionState
from robotd.errors import RobotdError
from robotd.robot import Robot
from robotd_ros.diagnostics.part_status import (
    DiagnosticLevel,
    PartStatus,
    axis_status,
    control_loop_status,
    engine_status,
    fieldbus_status,
    gripper_status,
    motion_status,
    unknown_status,
)

RECENT_S = 2.0  # for how long something that happened is worth a warning


class Health:
    """Evaluates a robot's health; for one thread that may wait for the fieldbus."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._cycles = Growth()
        self._missed = Growth()
        self._lost = [Growth() for _ in range(robot.fieldbus.buses)]

    def fingerprint(self) -> Hashable:
        """Another value whenever something changed that is reported at once. Cheap."""
        robot, image = self._robot, self._robot.image
        flags = (image.servo_on, image.amp_alarm, image.offline, image.alarm_code,
                 image.negative_limit, image.positive_limit, image.mode)  # fmt: skip
        gripper = robot.gripper is not None and robot.gripper.is_commanded_closed
        states = (robot.connection.state, robot.connection.ready, gripper)
        latch = robot.axes.stop_latch
        motion = latch.reason, latch.inactive, robot.axes.speed.text
        return (*states, *motion, *(array.tobytes() for array in flags))

    def statuses(self, bus_age_s: float = 0.0) -> list[PartStatus]:
        """Return the status of engine, axes, fieldbuses, control loop, motion and gripper.

        ``bus_age_s``: see ``Fieldbus.status``.
        """
        robot = self._robot
        state, now_ns = robot.connection.state, robot.clock.now_ns()
        connection = robot.connection
        image = robot.image.copy()
        fault = image.controller_fault or connection.fault
        step, ready = "" if connection.established else connection.step.text, connection.ready
        found = [engine_status(state, robot.backend.name, fault, step, ready=ready)]
        for axis, (name, limits) in enumerate(
            zip(robot.axes.names, robot.axes.limits, strict=True)
        ):
            outside = limits.excess(float(image.position[axis]))
            found.append(
                axis_status(name, axis, image, state, outside, used=axis in robot.servos.used)
            )
        found += [
            self._fieldbus(master, state, now_ns, bus_age_s) for master in range(len(self._lost))
        ]
        found += [self._control_loop(now_ns), self._motion()]
        if robot.gripper is not None:
            found.append(gripper_status(state, closed=robot.gripper.is_commanded_closed))
        return found

    def _motion(self) -> PartStatus:
        axes = self._robot.axes
        latch = axes.stop_latch
        return motion_status(latch.reason, axes.speed.text, latch.inactive)

    def _fieldbus(
        self, master: int, state: ConnectionState, now_ns: int, age_s: float
    ) -> PartStatus:
        part = "fieldbus" if len(self._lost) == 1 else f"fieldbus {master}"
        if state not in (ConnectionState.COMMUNICATING, ConnectionState.UNKNOWN):
            fault = self._robot.connection.fault
            return (
                PartStatus(part, DiagnosticLevel.ERROR, fault)
                if fault
                else unknown_status(part, state)
            )
        try:
            network = self._robot.fieldbus.status(master, age_s)
        except RobotdError as error:
            return PartStatus(part, DiagnosticLevel.ERROR, str(error))
        losing = self._lost[master].is_recent(network.lost_frames, now_ns)
        return fieldbus_status(part, network, losing=losing)

    def _control_loop(self, now_ns: int) -> PartStatus:
        control_loop, settings = self._robot.control_loop, self._robot.descriptor.cycle
        report = control_loop.stats.report()
        granted = f"SCHED_FIFO {settings.realtime_priority}" if control_loop.realtime else "none"
        return control_loop_status(
            report,
            settings.rate_hz,
            granted,
            running=self._cycles.is_recent(report.cycles, now_ns),
            missed=self._missed.is_recent(report.missed, now_ns),
        )


class Growth:
    """Notices that a counter has grown lately. One that is reset begins anew."""

    def __init__(self) -> None:
        self._count = 0
        self._grown_ns: int | None = None

    def is_recent(self, count: int, now_ns: int) -> bool:
        """Return True when ``count`` grew within the last ``RECENT_S``."""
        if count > self._count:
            self._grown_ns = now_ns
        self._count = count
        return self._grown_ns is not None and now_ns - self._grown_ns < RECENT_S * NANOSECONDS
