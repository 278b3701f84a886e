"""robotd_sim: simulated time on /clock, fault injection, and the services of both.

The nodes of this process get the time from the control loop, not from the topic: their stamps are
those of the period, exactly, whatever the topic costs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from rclpy.clock import ClockType
from rclpy.node import Node
from rclpy.time import Time
from rclpy.time_source import TimeSource
from robotd_msgs.srv import InjectFault, StepTime
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool

from robotd.api import NANOSECONDS, InvalidArgument, ProcessImage
from robotd.api.robots import PacedClock, Robot
from robotd_ros.failed_requests import value_of
from robotd_ros.host import RosHost
from robotd_ros.middleware import HotPublisher
from robotd_ros.run_nodes import NodeContext
from robotd_ros.services import add_service
from robotd_scenario import FaultSchedule, requested_fault
from robotd_scenario.feature import MAX_STEPS, SIMULATION_NODE, STEP_TIMEOUT_S

CLOCK_RATE_HZ = 500.0  # in simulated time


@contextmanager
def add_simulation_node(context: NodeContext, faults: FaultSchedule) -> Iterator[list[Node]]:
    """Make the node of a simulation; it ends with the host."""
    yield [SimulationNode(context.robot, context.host, context.nodes, faults)]


class SimulationNode(Node):
    """Node of a simulation: injects faults; on a ``PacedClock`` publishes /clock and steps time.

    Args:
        robot: on a simulated backend.
        host: whose workers answer.
        nodes: whose clocks follow simulated time; this node's own does too.
        faults: where faults are put.
    """

    def __init__(
        self, robot: Robot, host: RosHost, nodes: Sequence[Node], faults: FaultSchedule
    ) -> None:
        super().__init__(SIMULATION_NODE, context=host.context)
        self._faults = faults
        add_service(self, host, InjectFault, "~/inject", self._inject)
        if isinstance(robot.clock, PacedClock):
            self._time = _TimeServices(self, robot, robot.clock, host, nodes)

    def _inject(self, request: Any, response: Any) -> str:
        settings = {setting.name: value_of(setting) for setting in request.settings}
        fault = requested_fault(request.kind, settings)
        self._faults.add(fault)
        return str(fault)


class _TimeServices:
    """/clock, the clocks of the nodes, and the services that pause and step time."""

    def __init__(
        self, node: Node, robot: Robot, clock: PacedClock, host: RosHost, nodes: Sequence[Node]
    ) -> None:
        self._robot, self._time = robot, clock
        self._clocks = [member.get_clock() for member in (*nodes, node)]
        self._message = HotPublisher(node, "/clock", 10, Clock(), [])
        source = TimeSource()  # of no node: it subscribes to nothing
        source.ros_time_is_active = True
        source.clock_callback(Clock(clock=self._now().to_msg()))
        for ros_clock in self._clocks:
            source.attach_clock(ros_clock)
        control_loop, rate_hz = robot.control_loop, robot.descriptor.cycle.rate_hz
        control_loop.every(rate_hz, "clocks of the nodes", self._set_clocks, first=True)
        control_loop.every(min(CLOCK_RATE_HZ, rate_hz), "clock", self._publish, first=True)
        add_service(node, host, SetBool, "~/pause", self._pause)
        add_service(node, host, StepTime, "~/step", self._step)

    def _set_clocks(self, image: ProcessImage) -> None:
        now = self._now()
        for clock in self._clocks:
            clock.set_ros_time_override(now)

    def _now(self) -> Time:
        return Time(nanoseconds=self._time.now_ns(), clock_type=ClockType.ROS_TIME)

    def _publish(self, image: ProcessImage) -> None:
        self._message.stamp(self._time.now_ns())
        self._message.publish()

    def _pause(self, request: Any, response: Any) -> str:
        if request.data:
            self._time.pause()
        else:
            self._time.resume()
        return "time paused" if request.data else "time runs"

    def _step(self, request: Any, response: Any) -> str:
        periods = request.periods
        if not 1 <= periods <= MAX_STEPS:
            raise InvalidArgument(f"periods: {periods} is outside 1..{MAX_STEPS}")
        if not self._time.step(periods * self._robot.control_loop.period_ns, STEP_TIMEOUT_S):
            raise InvalidArgument(f"periods: {periods} take longer than {STEP_TIMEOUT_S:g} s")
        response.time = self._now().to_msg()
        return f"time paused at {self._time.now_ns() / NANOSECONDS:.6f} s"
