"""CANopen master: bus, nodes and axes of one network, and their cyclic exchange."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from canopen.objectdictionary import ObjectDictionary

from robotd.api import (
    NANOSECONDS,
    Clock,
    ConnectError,
    ConnectionState,
    FloatArray,
    ProcessImage,
    RobotDescriptor,
    get_logger,
)
from robotd_canopen.bring_up import BringUp
from robotd_canopen.bus import Bus
from robotd_canopen.canopen_drive import CanopenDrive
from robotd_canopen.feedback import Feedback
from robotd_canopen.forced_off import force_off
from robotd_canopen.frame import Frame
from robotd_canopen.io_image import IoImage
from robotd_canopen.layout import NetworkLayout
from robotd_canopen.node import NmtCommand, NmtState, Node
from robotd_canopen.options import NodeOptions
from robotd_canopen.supervision import Supervision
from robotd_canopen.sync_gate import SyncGate
from robotd_cia402.axes import Cia402Master, name_and_scaling
from robotd_cia402.axis import Axis
from robotd_cia402.guiding import make_guiding
from robotd_cia402.sync_timing import SyncTiming

log = get_logger("canopen")

_DRIVE, _IO = 402, 401
MAX_AGE_SYNCS = 3  # SYNCs after which a frame is no longer to be executed by a drive
_LONGEST_PERIODS = 2  # periods that one longer period counts for at most
_SYNC, _HEARTBEAT = 0x080, 0x700


class SyncProducer:
    """Sends SYNC and, when it is due, the master's heartbeat. Control loop.

    Drives lock their clocks to SYNC, so their reports belong to the nominal times of the SYNCs,
    not to the jittered times at which this computer sent them.

    Attributes:
        count: SYNCs sent, and those withheld.
        timing: nominal time of the last SYNC, monotonic.
        before_ns: nominal time of the one before; 0 without one.
        periods: whole periods from the SYNC before to the last one: above 1 if some were skipped, 0
            for one close behind a late one.
        jitter_ns: largest deviation of the distance of two SYNCs from the period.
    """

    def __init__(
        self, bus: Bus, clock: Clock, period_s: float, heartbeat_s: float, master_node: int
    ) -> None:
        self.count = self.before_ns = self.jitter_ns = 0
        self.periods = 1
        self._bus, self._clock = bus, clock
        self.timing = SyncTiming(round(period_s * NANOSECONDS))
        self._heartbeat_ns = round(heartbeat_s * NANOSECONDS)
        self._heartbeat_due_ns = self._sent_ns = 0
        self._sync_frame = Frame(_SYNC, b"")
        self._heartbeat_frame = Frame(_HEARTBEAT + master_node, bytes([NmtState.OPERATIONAL]))

    def begin(self) -> None:
        """Worker: communication starts; do not count the pause before as jitter."""
        self._sent_ns = 0

    def send(self, *, withheld: bool = False) -> None:
        """Send SYNC, and the heartbeat if it is due; ``withheld``: only count the SYNC.

        A process may be stopped before the kernel has the frame, or right after. The time is taken
        before: the drives then count for moving, because a setpoint that drives at rest execute is
        better than one withheld from drives that move, which would go back to the one before.
        """
        self._clock.sleep_until_ns(self.timing.clear_ns(self._clock.now_ns()))
        now_ns = self._clock.now_ns()
        if not withheld:
            self._bus.send(self._sync_frame)
        self._note(now_ns)
        if now_ns >= self._heartbeat_due_ns and not withheld:
            self._heartbeat_due_ns = now_ns + self._heartbeat_ns
            self._bus.send(self._heartbeat_frame)
            self._bus.measure_load(now_ns)

    def _note(self, now_ns: int) -> None:
        if self._sent_ns:
            deviation_ns = abs(now_ns - self._sent_ns - self.timing.period_ns)
            self.jitter_ns = max(self.jitter_ns, deviation_ns)
        self._sent_ns = now_ns
        self.count += 1
        self.before_ns = self.timing.time_ns
        self.periods = self.timing.note_event(now_ns)


class Master(Cia402Master[CanopenDrive]):
    """State shared by the drivers of one network.

    Attributes:
        layout, options: as planned and given.
        nodes: by node id.
        bus, io, feedback, sync, gate, supervision: the parts.
    """

    io: IoImage
    settle_cycles = 1

    def __init__(self, robot: RobotDescriptor, layout: NetworkLayout, clock: Clock) -> None:
        self.layout, self.options = layout, layout.options
        options, period_s = layout.options, layout.sync_period_s
        super().__init__(clock, period_s, options.stream_timeout_s)
        priority = max(0, robot.cycle.realtime_priority - 1)
        self.bus = Bus(options.bus, priority, MAX_AGE_SYNCS * layout.frames_per_sync)
        self.bus_name = self.bus.name
        self.feedback = Feedback(layout.axes, period_s, robot.engine.stale_after_s)
        self.feedback.echoes = options.bus.echoes
        self.bus.subscribe(_SYNC, self.feedback.note_sync)
        self.sync = SyncProducer(
            self.bus, clock, period_s, options.heartbeat_s, options.master_node
        )
        self.timing = self.sync.timing
        self.gate = SyncGate(period_s, options.heartbeat_timeout_s)
        self.nodes: dict[int, Node] = {}
        self._make_axes(robot)
        self.guiding = make_guiding(robot, self.axes)
        modules = [
            (self._add_node(module.options, "I/O module", _IO, module.dictionary), module)
            for module in layout.io
        ]
        self.io = IoImage(self.bus, modules, self.gate)
        self.supervision = Supervision(
            self.bus, self.nodes, self.axes, self.feedback, options.heartbeat_timeout_s, period_s
        )
        self._bring_up = BringUp(
            layout,
            self.axes,
            self.bus.name,
            self.supervision.release,
            allow_partial=options.allow_partial,
        )
        self._state = ConnectionState.IDLE
        self._read_ns = 0
        self._period_ns = round(NANOSECONDS / robot.cycle.rate_hz)
        self._transmitted = True

    @property
    def state(self) -> ConnectionState:
        lost = self._state is ConnectionState.COMMUNICATING and self.supervision.lost
        return ConnectionState.UNKNOWN if lost else self._state

    def fault(self) -> str:
        return self.supervision.fault()

    def summary(self) -> str:
        drives = {axis.drive.node.number for axis in self.axes}
        silent = [node.name for node in self.nodes.values() if node.fault or not node.identity]
        missing = f"; no answer from {', '.join(silent)}" if silent else ""
        return (
            f"CANopen on {self.bus_name}: {len(drives)} drives,"
            f" {len(self.nodes) - len(drives)} I/O modules,"
            f" computed bus load {self.layout.bus_load:.0%}{missing}"
        )

    def open(self) -> None:
        self.bus.open()
        try:
            self._bring_up.identify(self.nodes.values())
        except ConnectError:
            self.bus.close()
            raise
        self._state = ConnectionState.RUNNING

    def close(self) -> None:
        self._leave_all(ConnectionState.IDLE)
        self.bus.close()

    def start(self, timeout_s: float) -> None:
        """Configure and start the nodes that are not online. Raises ConnectError.

        ``timeout_s``: see ``BringUp.start``.
        """
        if self.bus.fault is not None:
            self.bus.open()
            for node in self.nodes.values():
                node.online = node.configured = False
        waiting = [node for node in self.nodes.values() if not node.online]
        self.io.forget(waiting)
        self._bring_up.start(waiting, timeout_s)  # where it fails, some nodes may have started
        self.io.start()
        self.sync.begin()
        self._state = ConnectionState.COMMUNICATING

    def end(self) -> None:
        online = [node for node in self.nodes.values() if node.online]
        unconfirmed = {axis.drive.node.number for axis in self.axes if axis.power.may_be_on}
        self._leave_all(ConnectionState.RUNNING)  # missing heartbeats are expected from now on
        for node in online:
            if node.number not in unconfirmed:  # else let it stop by itself, should all else fail
                _try(node, partial(node.watch_master, watch=False))
            _try(node, partial(node.command, NmtCommand.PRE_OPERATIONAL))

    def force_off(self, axes: Sequence[Axis[CanopenDrive]]) -> None:
        force_off(axes, self.clock)

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
            self._transmit()  # where no setpoint came
            self._watch_gate()
            self.sync.send(withheld=not self.gate.sends)
            self.feedback.syncs = self.sync.count
            self._transmitted = False
        # After a pause of this computer the frames of the nodes are still waiting to be read.
        elapsed_ns = min(now_ns - self._read_ns, _LONGEST_PERIODS * self._period_ns)
        self._read_ns = now_ns
        self.supervision.watch(elapsed_ns, now_ns)
        if problem := self.stream_problem(now_ns):
            self.supervision.fail(problem)
        for axis in self.axes:
            axis.observe(image)
        self.guide(self._period_ns / NANOSECONDS)
        # While one drive is late the time of the image stays: the values of the others would be of
        # another SYNC.
        behind = self.feedback.behind(image.offline)
        if self.sync.count > behind < 2:
            image.fresh_ns = self.sync.before_ns if behind else self.timing.time_ns
        if not any(axis.activity.streaming for axis in self.axes):
            self._transmit_before_sync()

    def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
        super().stream(position, velocity, due_ns)
        self._transmit_before_sync()

    def stream_torque(self, torque: FloatArray, due_ns: int) -> None:
        """Control loop: torques; another group's ``stream`` sends them where it runs."""
        super().stream_torque(torque, due_ns)
        if all(axis.mode.requested.is_torque or not axis.activity.streaming for axis in self.axes):
            self._transmit_before_sync()

    def _transmit_before_sync(self) -> None:
        """Send the RPDOs in the last control period before a SYNC."""
        if (self._cycles + 1) % self.layout.cycles_per_sync == 0:
            self._transmit()

    def _transmit(self) -> None:
        """Send the RPDOs, once per SYNC."""
        if self._transmitted:
            return
        self._transmitted = True
        if self.feedback.unanswered >= MAX_AGE_SYNCS:
            self.bus.discard_unsent()
        for axis in self.axes:
            axis.transmit(self.period_s, self.sync.periods)
            axis.drive.send_waiting()

    def _watch_gate(self) -> None:
        """Close the gate while frames may wait in the adapter."""
        if not self.bus.keeps_unsent:
            return
        unanswered = self.feedback.unanswered
        if self.axes and not any(axis.drive.node.online for axis in self.axes):
            # Drives whose PDOs are all event-driven answer no SYNC; their heartbeats show the loss.
            unanswered = unanswered if self.feedback.is_synchronous else MAX_AGE_SYNCS
        self.gate.advance(unanswered, self.bus.counters.received)

    def _leave_all(self, state: ConnectionState) -> None:
        self._state = state
        for node in self.nodes.values():
            node.online, node.configured, node.fault = False, False, ""
        for axis in self.axes:
            axis.drive.forget()  # values of this connection; the next one has new ones
        self.supervision.begin()

    def _make_axes(self, robot: RobotDescriptor) -> None:
        for number, layout in enumerate(self.layout.axes):
            name, scaling = name_and_scaling(robot, layout.options)
            node = self._add_node(layout.options, name, _DRIVE, layout.dictionary)
            drive = CanopenDrive(number, layout, node, self.feedback, self.bus, self.gate)
            self._add_axis(layout.options, drive, scaling)
            for pdo in layout.tpdos:
                self.bus.subscribe(pdo.cob_id, self.feedback.handler(number, pdo, scaling))

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
            what,
            profile,
            dictionary,
            self.options,
            self.emergencies,
            self.clock,
        )
        self.nodes[options.node] = node
        return node


def _try(node: Node, action: Callable[[], None]) -> None:
    try:
        action()
    except Exception as error:  # noqa: BLE001 - the other nodes are stopped all the same
        log.warning("stopping a node failed", node=node.name, reason=str(error))
