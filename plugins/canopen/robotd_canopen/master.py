"""CANopen master: bus, nodes and axes of one network, and their cyclic exchange."""

from __future__ import annotations

from collections.abc import Sequence

from canopen.objectdictionary import ObjectDictionary

from robotd.api import (
    NANOSECONDS,
    Clock,
    ConnectError,
    ConnectionState,
    LateSetpoint,
    ProcessImage,
    RobotDescriptor,
    wait_until,
)
from robotd_canopen.bring_up import BringUp
from robotd_canopen.bus import Bus
from robotd_canopen.canopen_axis import CanopenAxis
from robotd_canopen.feedback import Feedback
from robotd_canopen.io_image import IoImage
from robotd_canopen.layout import NetworkLayout
from robotd_canopen.node import Node
from robotd_canopen.options import NodeOptions
from robotd_canopen.supervision import Supervision
from robotd_canopen.sync_producer import SyncProducer
from robotd_cia402.emcy import EmergencyLog
from robotd_cia402.scaling import Scaling
from robotd_cia402.stream_timeout import StreamTimeout

_DRIVE, _IO = 402, 401
_LONGEST_PERIODS = 2  # periods that one longer period counts for at most


class Master:
    """State shared by the four drivers."""

    def __init__(self, robot: RobotDescriptor, layout: NetworkLayout, clock: Clock) -> None:
        self.layout, self.clock = layout, clock
        self.options = options = layout.options
        self.bus = Bus(options.bus, max(0, robot.cycle.realtime_priority - 1))
        self.emergencies = EmergencyLog()
        period_s = self.layout.sync_period_s
        self.feedback = Feedback(self.layout.axes, period_s, robot.engine.stale_after_s)
        self.sync = SyncProducer(
            self.bus, clock, period_s, options.heartbeat_s, options.master_node
        )
        self.nodes: dict[int, Node] = {}
        self.axes = self._make_axes(robot)
        modules = [
            (self._add_node(module.options, "I/O module", _IO, module.dictionary), module)
            for module in self.layout.io
        ]
        self.io = IoImage(self.bus, modules)
        self.supervision = Supervision(
            self.bus, self.nodes, self.axes, self.feedback, options.heartbeat_timeout_s, period_s
        )
        self._bring_up = BringUp(
            self.layout, self.axes, self.bus.name, allow_partial=options.allow_partial
        )
        self._state = ConnectionState.IDLE
        self._cycles = self._read_ns = 0
        self._period_ns = round(NANOSECONDS / robot.cycle.rate_hz)
        self._transmitted = True
        self._stream = StreamTimeout(clock, options.stream_timeout_s)

    @property
    def state(self) -> ConnectionState:
        """UNKNOWN while a node or the bus is lost."""
        lost = self._state is ConnectionState.COMMUNICATING and self.supervision.lost
        return ConnectionState.UNKNOWN if lost else self._state

    def open(self) -> None:
        """Open the bus and identify every node. Raises ConnectError."""
        self.bus.open()
        try:
            self._bring_up.identify(self.nodes.values())
        except ConnectError:
            self.bus.close()
            raise
        self._state = ConnectionState.RUNNING

    def close(self) -> None:
        self._state = ConnectionState.IDLE
        self._leave_all()
        self.bus.close()

    def start(self, timeout_s: float) -> None:
        """Configure and start the nodes that are not online. Raises ConnectError.

        ``timeout_s``: as of ``BringUp.start``.
        """
        if self.bus.fault is not None:
            self.bus.open()
            for node in self.nodes.values():
                node.online = node.configured = False
        waiting = [node for node in self.nodes.values() if not node.online]
        self.io.forget(waiting)
        self._bring_up.start(waiting, timeout_s)  # where it fails, some nodes may have started
        self.io.start()
        self.supervision.begin()
        self.sync.begin()
        self._state = ConnectionState.COMMUNICATING

    def end(self) -> None:
        """End the supervision of the nodes: communication has been stopped."""
        self._state = ConnectionState.RUNNING
        self._leave_all()

    def read(self, image: ProcessImage) -> None:
        """Control loop: send SYNC, supervise the nodes, fill the image.

        A lost node is no error here: its axes are offline in ``image``, with the reason.
        """
        now_ns = self.clock.now_ns()
        if self._state is not ConnectionState.COMMUNICATING:
            image.offline[:] = True
            return
        self._cycles += 1
        self.feedback.take()
        if self._cycles % self.layout.cycles_per_sync == 0:
            if not self._transmitted:
                self._transmit()
            self.sync.send()
            self.feedback.syncs = self.sync.count
            self._transmitted = False
        self._watch(now_ns)
        for axis in self.axes:
            axis.observe(image)
        self._date(image)
        if not any(axis.activity.streaming for axis in self.axes):
            self._transmit()

    def stream(self, position: Sequence[float], velocity: Sequence[float], due_ns: int) -> None:
        """Control loop: send setpoints to the axes that stream, due at ``due_ns``.

        Raises LateSetpoint when they are from before a stall in which the drives have come to
        rest: they would move by the way of one period, and stop again.
        """
        now_ns = self._stream.restart()
        if self.sync.after_rest and now_ns > due_ns:
            raise LateSetpoint
        for axis in self.axes:
            if axis.activity.streaming:
                axis.follow(position[axis.number], velocity[axis.number])
        self._transmit()

    def stream_torque(self, torque: Sequence[float]) -> None:
        """Control loop: torques; another group's ``stream`` sends them where it runs."""
        self._stream.restart()
        for axis in self.axes:
            axis.follow_torque(torque[axis.number])
        if all(axis.mode.requested.is_torque or not axis.activity.streaming for axis in self.axes):
            self._transmit()

    def begin_stream(self) -> None:
        """Start the time-out of the stream."""
        self._stream.restart()

    def settle(self) -> None:
        """Worker: wait until the image shows the latest change.

        Returns after 10 SYNC periods where no control loop runs.
        """
        seen = self._cycles
        period_s = self.layout.sync_period_s
        wait_until(lambda: self._cycles > seen + 1, 10 * period_s, self.clock, period_s / 4)

    def _transmit(self) -> None:
        """Send the RPDOs once per SYNC, in the last control period before it."""
        last = (self._cycles + 1) % self.layout.cycles_per_sync == 0
        if self._transmitted or not last:
            return
        self._transmitted = True
        for axis in self.axes:
            if axis.node.online:
                axis.transmit(self.layout.sync_period_s, self.sync.periods)
                axis.rpdos.send(self.bus)

    def _date(self, image: ProcessImage) -> None:
        """Set the time of the image to the latest SYNC that all drives have answered.

        While one drive is late the time stays: the values of the others would be of another SYNC.
        """
        behind = self.feedback.behind(image.offline)
        if self.sync.count > behind < 2:
            image.fresh_ns = self.sync.before_ns if behind else self.sync.time_ns

    def _watch(self, now_ns: int) -> None:
        # After a pause of this computer the frames of the nodes are still waiting to be read.
        elapsed_ns = min(now_ns - self._read_ns, _LONGEST_PERIODS * self._period_ns)
        self._read_ns = now_ns
        self.supervision.watch(elapsed_ns, now_ns)
        streaming = (axis.node.name for axis in self.axes if axis.activity.streaming)
        if problem := self._stream.problem(now_ns, streaming):
            self.supervision.fail(problem)

    def _leave_all(self) -> None:
        for node in self.nodes.values():
            node.online, node.configured, node.fault = False, False, ""
        for axis in self.axes:
            self.feedback.forget(axis.number)  # of this connection; the next one has new values
        self.supervision.begin()

    def _make_axes(self, robot: RobotDescriptor) -> list[CanopenAxis]:
        joints = {joint.axis: joint for joint in robot.joints}
        axes = []
        for number, layout in enumerate(self.layout.axes):
            joint = joints.get(number)
            name = joint.name if joint else f"axis {number}"
            node = self._add_node(layout.options, name, _DRIVE, layout.dictionary)
            known = (joint.rated_effort, joint.velocity) if joint else (None, None)
            scaling = Scaling(layout.options, *known)
            axes.append(CanopenAxis(number, layout, node, self.feedback, scaling))
            for pdo in layout.tpdos:
                self.bus.subscribe(pdo.cob_id, self.feedback.handler(number, pdo, scaling))
        return axes

    def _add_node(
        self, options: NodeOptions, what: str, profile: int, dictionary: ObjectDictionary
    ) -> Node:
        """Return the node of an axis or module; axes of one drive share it."""
        known = self.nodes.get(options.node)
        if known is not None:
            known.share(options, dictionary)
            return known
        node = Node(
            self.bus,
            options,
            f"{what} (node {options.node})",
            profile,
            dictionary,
            self.options,
            self.emergencies,
            self.clock,
        )
        self.nodes[options.node] = node
        return node
