"""A robot on simulated CANopen drives, and what the tests want of it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import MonotonicClock, wait_until
from robotd.control.sources.trajectory_execution import TrajectoryExecution
from robotd.device.bus_status import BusStatus
from robotd.device.process_image import ProcessImage
from robotd.motion import TrajectoryRequest
from robotd.robot import Robot
from robotd_canopen.fieldbus import CanopenFieldbus
from robotd_canopen.master import Master
from robotd_canopen.simulated import DriveNode, IoNode, SimulatedNetwork
from robotd_canopen.simulated_robot import Simulation, inject, simulated_network
from robotd_cia402.device import Cia402Device

STEEP_RAD_S2 = 60.0  # beyond every ramp that is configured (10 and 40), below any jump
SPAN = 5  # periods over which a ramp is measured


class Harness:
    """One robot. Any thread."""

    def __init__(self, robot: Robot) -> None:
        self.robot, self.image = robot, robot.image
        wrapped = vars(robot.connection._driver)["wrapped"]
        self.device = cast("Cia402Device[Master, Simulation]", wrapped)
        self.master: Master = self.device.master

    @property
    def network(self) -> SimulatedNetwork:
        assert self.device.simulation is not None
        return self.device.simulation.network

    def power_on(self) -> None:
        """Start the drives before the bus is opened."""
        assert self.device.simulation is not None
        self.device.simulation.start()

    def drive(self, node: int) -> DriveNode:
        return cast(DriveNode, self.network.members[node])

    def module(self, node: int) -> IoNode:
        return cast(IoNode, self.network.members[node])

    def inject(self, line: str) -> None:
        assert inject(self.network, line) == "ok"

    def until(self, condition: Callable[[], bool], timeout_s: float = 60.0) -> None:
        assert wait_until(condition, timeout_s, MonotonicClock())

    def idle(self, axis: int) -> None:
        """Wait for the end of a command, which the image shows a period later."""
        self.master.settle()
        self.until(lambda: not self.image.operation[axis])

    def request(self, seconds: float, target: float) -> TrajectoryRequest:
        names = self.robot.joint_names
        return TrajectoryRequest.from_rows(names, [seconds], [[target] * len(names)])

    def device_state(self) -> BusStatus:
        """Return the state of the fieldbus driver, in any state of the connection."""
        return CanopenFieldbus(self.master).status(0)

    def break_bus(self) -> None:
        """The adapter is unplugged."""
        opened = self.master.bus._can
        assert opened is not None
        opened.shutdown()

    def pause_cycle(self, seconds: float) -> None:
        """Stop the control loop for a time, as a busy computer does."""
        stood = threading.Event()

        def stand(image: ProcessImage) -> None:
            if not stood.is_set():
                time.sleep(seconds)
                stood.set()

        self.robot.control_loop.every(1000, "pause", stand)
        assert stood.wait(seconds + 5)

    def second_network(self) -> SimulatedNetwork:
        """The same nodes once more, on the same bus."""
        return simulated_network(self.robot.descriptor, self.master.options)

    def threads(self) -> list[threading.Thread]:
        """Threads that must never end: control loop, receive thread, simulated drives."""
        found = [
            self.robot.control_loop._thread,
            self.master.bus._thread,
            self.network._thread,
        ]
        return [thread for thread in found if thread is not None]

    def follow(self, seconds: float, target: float) -> TrajectoryExecution:
        """Run a trajectory of one point to its end, whatever that is.

        Repeated, at most twice, when the computer stalled the control loop for too long.
        """
        execution = self._follow_once(seconds, target)
        for _ in range(2):
            if "control-loop stall" not in execution.message:
                break
            self.robot.servos.enable()
            execution = self._follow_once(seconds, target)
        return execution

    def _follow_once(self, seconds: float, target: float) -> TrajectoryExecution:
        with self.robot.follower.follow(self.request(seconds, target)) as execution:
            assert execution.wait(seconds + 15)
        return execution

    def positions(self) -> FloatArray:
        return np.array(self.image.copy().position)


@dataclass(frozen=True)
class Stop:
    """Result of a trajectory with a fault.

    Attributes:
        steepest_rad_s2: steepest ramp of the healthy axes.
        was_late: control loop or drives were late, so that ramps cannot be computed.
    """

    execution: TrajectoryExecution
    steepest_rad_s2: float
    was_late: bool

    @property
    def is_controlled(self) -> bool:
        """Return True if no axis has jumped, as far as the timing allows to judge."""
        return self.was_late or self.steepest_rad_s2 < STEEP_RAD_S2


def broken(
    harness: Harness, fault: str | Callable[[], None], healthy: Sequence[int] = (0,)
) -> Stop:
    """A trajectory during which ``fault`` happens; returns when the ``healthy`` axes stand.

    They are still switched on then.
    """
    chosen = list(healthy)
    rows: list[tuple[int, int, FloatArray]] = []

    def note(image: ProcessImage) -> None:
        rows.append((image.stamp_ns, image.fresh_ns, image.velocity[chosen].copy()))

    with harness.robot.follower.follow(harness.request(1.5, 0.8)) as execution:
        harness.robot.control_loop.every(1000, "speeds", note)
        harness.until(lambda: harness.image.position[0] > 0.2)
        if callable(fault):
            fault()
        else:
            harness.inject(fault)
        assert execution.wait(15)
    harness.until(lambda: not harness.image.operation[chosen].any())
    harness.until(lambda: bool((np.abs(harness.image.velocity[chosen]) < 0.01).all()))
    assert harness.image.servo_on[chosen].all()
    stamps_ns, fresh_ns, speeds = (np.array(column) for column in zip(*rows, strict=True))
    limit_ns = 1.5 * harness.robot.control_loop.period_ns
    was_late = bool(
        (np.diff(stamps_ns) > limit_ns).any() or (stamps_ns - fresh_ns > limit_ns).any()
    )
    spans_s = (stamps_ns[SPAN:] - stamps_ns[:-SPAN]) * 1e-9
    changes = np.abs(speeds[SPAN:] - speeds[:-SPAN])
    return Stop(execution, float((changes / spans_s[:, np.newaxis]).max(initial=0.0)), was_late)
