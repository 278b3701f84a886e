"""The master: bus, nodes and axes of one network, bring-up, supervision, and the SYNC."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor

from robotd.plugin.api import (
    Clock,
    ConnectError,
    EngineState,
    OperationError,
    ProcessImage,
    RobotdError,
    RobotDescriptor,
    get_logger,
    wait_until,
)
from robotd_canopen.axis import Axis
from robotd_canopen.bus import Bus, frame
from robotd_canopen.emcy import EmergencyLog
from robotd_canopen.feedback import Feedback
from robotd_canopen.image import fill
from robotd_canopen.io_image import IoImage
from robotd_canopen.layout import NetworkLayout, plan_network
from robotd_canopen.modes import needed_modes
from robotd_canopen.nmt import NmtState
from robotd_canopen.node import Node
from robotd_canopen.options import AxisOptions, CanopenOptions
from robotd_canopen.scaling import Scaling

log = get_logger("canopen")

NANOSECONDS = 1_000_000_000
_SYNC, _HEARTBEAT = 0x080, 0x700
_DRIVE, _IO = 402, 401
_HALT_RAMP, _QUICK_STOP_STAYS, _FAULT_ON_LOSS = 1, 6, 1  # 0x605D, 0x605A, 0x6007


class Master:
    """Everything that the four drivers share.

    Attributes:
        faults: the latest losses of nodes and of the bus, newest last, as text.
        sync_jitter_ns: largest deviation of the distance of two SYNCs from the period.
    """

    def __init__(self, robot: RobotDescriptor, options: CanopenOptions, clock: Clock) -> None:
        self.options, self.clock = options, clock
        self.layout: NetworkLayout = plan_network(robot, options)
        self.bus = Bus(options.bus, clock, max(0, robot.cycle.realtime_priority - 1))
        self.emergencies = EmergencyLog()
        self.feedback = Feedback(
            self.layout.axes, self.layout.sync_period_s, robot.engine.stale_after_s
        )
        self.nodes: dict[int, Node] = {}
        self.axes = self._make_axes(robot)
        self.io = IoImage(self.bus, self.layout.io)
        self._make_io_nodes()
        self.state = EngineState.IDLE
        self.faults: list[str] = []
        self.sync_jitter_ns = 0
        self._sync_ns = 0
        self._cycles = 0
        self._transmitted = True
        self._heartbeat_due_ns = 0
        self._stream_ns = 0
        self._stale_ns = round(2 * robot.engine.stale_after_s * NANOSECONDS)
        self._stream_timeout_ns = round(options.stream_timeout_s * NANOSECONDS)
        self._heartbeat_limit_ns = round(options.heartbeat_timeout_s * NANOSECONDS)
        self._sync_frame = frame(_SYNC, b"")
        self._heartbeat_frame = frame(
            _HEARTBEAT + options.master_node, bytes([NmtState.OPERATIONAL])
        )

    def open(self) -> None:
        """Open the bus, and let every node say who it is. Raises ConnectError."""
        self.bus.open()
        try:
            self._bring_up(
                self.nodes.values(), "the nodes do not answer as expected", Node.identify
            )
        except ConnectError:
            self.bus.close()
            raise
        self.state = EngineState.RUNNING

    def close(self) -> None:
        self.state = EngineState.IDLE
        for node in self.nodes.values():
            node.online = False
        self.bus.close()

    def start(self) -> None:
        """Configure and start the nodes that are not online. Raises ConnectError."""
        if self.bus.fault is not None:
            self.bus.open()
            for node in self.nodes.values():
                node.online = False
                node.rebooted = True
        waiting = [node for node in self.nodes.values() if not node.online]
        self._bring_up(waiting, "the nodes do not start", self._start_node)
        self.io.start([node.id for node in waiting if node.online], self.nodes)
        self.state = EngineState.COMMUNICATING

    def lose(self, node: Node, reason: str) -> None:
        """Cycle: ``node`` is given up and all axes stop."""
        if node.online:
            node.online = False
            node.fault = f"{node.name}: {reason}{node.emergency_text()}"
            self._fail(node.fault)

    def read(self, image: ProcessImage) -> None:
        """Cycle: SYNC, then what the drives said, then the watch over them.

        Raises OperationError, with the image filled all the same, while a node or the bus is
        lost: so the reason, not the age of a value, ends what runs.
        """
        now_ns = self.clock.now_ns()
        if self.state not in (EngineState.COMMUNICATING, EngineState.UNKNOWN):
            image.offline[:] = True
            return
        self._cycles += 1
        if self._cycles % self.layout.cycles_per_sync == 0:
            if not self._transmitted:
                self._transmit()
            self._sync(now_ns)
        fill(image, self.axes, self.feedback)
        missed = self.feedback.missed()
        lost = self.state is EngineState.UNKNOWN
        if missed < self.feedback.syncs and not lost:
            image.fresh_ns = now_ns - round(missed * self.layout.sync_period_s * NANOSECONDS)
        self._watch(now_ns)
        if not any(axis.following for axis in self.axes):
            self._transmit()
        if lost:
            # The values of a lost node are too old to be true, whatever their number of SYNCs.
            image.fresh_ns = min(image.fresh_ns, now_ns - self._stale_ns)
            raise OperationError(self.faults[-1])

    def stream(self, position: Sequence[float], velocity: Sequence[float]) -> None:
        """Cycle: setpoints for the axes that follow."""
        self._stream_ns = self.clock.now_ns()
        for axis in self.axes:
            if axis.following:
                axis.follow(position[axis.number], velocity[axis.number])
        self._transmit()

    def begin_stream(self) -> None:
        """The time-out of the stream starts now."""
        self._stream_ns = self.clock.now_ns()

    def settle(self) -> None:
        """Worker: wait until the image shows what has just been changed.

        Returns early where nobody runs the cycle.
        """
        seen = self._cycles
        period_s = self.layout.sync_period_s
        wait_until(lambda: self._cycles > seen + 1, 10 * period_s, self.clock, period_s / 4)

    def _sync(self, now_ns: int) -> None:
        self.bus.send(self._sync_frame)
        period_ns = self.layout.sync_period_s * NANOSECONDS
        if self.feedback.syncs:
            jitter_ns = abs(now_ns - self._sync_ns - period_ns)
            self.sync_jitter_ns = max(self.sync_jitter_ns, round(jitter_ns))
        self._sync_ns = now_ns
        self.feedback.syncs += 1
        self._transmitted = False
        if now_ns >= self._heartbeat_due_ns:
            self._heartbeat_due_ns = now_ns + round(self.options.heartbeat_s * NANOSECONDS)
            self.bus.send(self._heartbeat_frame)

    def _transmit(self) -> None:
        """RPDOs once for each SYNC, in the last cycle before it."""
        last = (self._cycles + 1) % self.layout.cycles_per_sync == 0
        if self._transmitted or not last:
            return
        self._transmitted = True
        for axis in self.axes:
            if axis.node.online:
                axis.transmit(self.bus, self.layout.sync_period_s)

    def _watch(self, now_ns: int) -> None:
        if self.bus.fault is not None:
            for node in self.nodes.values():
                self.lose(node, self.bus.fault)
            return
        for node in self.nodes.values():
            reason = node.missing(now_ns, self._heartbeat_limit_ns)
            if node.online and reason:
                self.lose(node, reason)
            elif node.fault and not reason and not node.rebooted:
                self._take_back(node)
        self._watch_pdos()
        if now_ns - self._stream_ns > self._stream_timeout_ns:
            for axis in self.axes:
                if axis.following:
                    self._fail(
                        f"{axis.node.name}: no setpoint for {self.options.stream_timeout_s} s"
                    )

    def _watch_pdos(self) -> None:
        for number, pdo, missed in self.feedback.stale():
            age_ms = missed * self.layout.sync_period_s * 1000
            self.lose(self.axes[number].node, f"{pdo.name} has not come for {age_ms:.0f} ms")

    def _take_back(self, node: Node) -> None:
        """A node that was silent and has kept its configuration; its axes stay where they are."""
        axes = [axis for axis in self.axes if axis.node is node]
        if any(self.feedback.overdue(axis.number) for axis in axes):
            return
        for axis in axes:
            axis.resume()
        node.online, node.fault = True, ""
        log.info("a node is back", node=node.name)
        if all(one.online for one in self.nodes.values() if one.fault):
            self.state = EngineState.COMMUNICATING

    def _fail(self, reason: str) -> None:
        self.faults.append(reason)
        del self.faults[:-100]
        log.error("motion is stopped", reason=reason)
        for axis in self.axes:
            axis.brake(axis.layout.options.stop_deceleration_rad_s2)
        if self.state is EngineState.COMMUNICATING and any(
            not node.online and node.fault for node in self.nodes.values()
        ):
            self.state = EngineState.UNKNOWN

    def _bring_up(self, nodes: Iterable[Node], message: str, step: Callable[[Node], None]) -> None:
        """``step`` for all nodes at once; every failure is reported. Raises ConnectError."""
        work = list(nodes)
        failures: dict[str, str] = {}

        def attempt(node: Node) -> None:
            try:
                step(node)
            except RobotdError as error:
                failures[f"canopen → {self.bus.name} → {node.name}"] = str(error)
            except Exception as error:  # noqa: BLE001 - reported like any other
                failures[f"canopen → {self.bus.name} → {node.name}"] = repr(error)

        if work:
            with ThreadPoolExecutor(len(work), thread_name_prefix="canopen-start") as pool:
                list(pool.map(attempt, work))
        if not failures:
            return
        if not self.options.allow_partial or len(failures) == len(self.nodes):
            raise ConnectError(message, failures)
        for path, reason in failures.items():
            log.warning("a node is left out", node=path, reason=reason)

    def _start_node(self, node: Node) -> None:
        if not node.identity or node.fault:
            node.identify()
        drives = [axis for axis in self.axes if axis.node is node]
        node.configure(self.layout.pdos(node.id))
        for axis in drives:
            self._prepare(axis)
        node.start()

    def _prepare(self, axis: Axis) -> None:
        """Modes that the drive must have, and how it shall react. Nothing moves."""
        layout, options, sdo = axis.layout, axis.layout.options, axis.node.sdo
        supported = sdo.read(layout.index(0x6502))
        for mode, what in needed_modes(options).items():
            if not supported & mode.support_bit:
                raise OperationError(
                    f"modes: {what} needs {mode.name.lower()}, which object 0x6502"
                    f" (0x{supported:08X}) does not offer"
                )
        quick = axis.scaling.ramp_units(options.quick_stop_deceleration_rad_s2)
        value, exponent = _interpolation_period(self.layout.sync_period_s)
        for index, sub, number in (
            (0x6007, 0, _FAULT_ON_LOSS),
            (0x605A, 0, _QUICK_STOP_STAYS),
            (0x605D, 0, _HALT_RAMP),
            (0x6085, 0, quick),
            (0x60C2, 1, value),
            (0x60C2, 2, exponent),
        ):
            if layout.index(index) in sdo.dictionary:
                sdo.write(layout.index(index), sub, number)
        axis.forget()

    def _make_axes(self, robot: RobotDescriptor) -> list[Axis]:
        joints = {joint.axis: joint for joint in robot.joints}
        axes = []
        for number, layout in enumerate(self.layout.axes):
            joint = joints.get(number)
            node = self._node(layout.options, joint.name if joint else f"axis {number}")
            scaling = Scaling(layout.options, joint.rated_torque_nm if joint else None)
            axes.append(Axis(number, layout, node, self.feedback, scaling))
            for pdo in layout.tpdos:
                self.bus.subscribe(pdo.cob_id, self.feedback.handler(number, pdo))
        return axes

    def _node(self, options: AxisOptions, name: str) -> Node:
        """The node of an axis; axes of one drive share it."""
        known = self.nodes.get(options.node)
        if known is not None:
            known.startup.extend(options.startup)
            return known
        layout = next(one for one in self.layout.axes if one.options is options)
        node = Node(
            self.bus,
            options,
            f"{name} (node {options.node})",
            _DRIVE,
            layout.dictionary,
            self.options,
            self.emergencies,
            self.clock,
        )
        self.nodes[options.node] = node
        return node

    def _make_io_nodes(self) -> None:
        for layout in self.layout.io:
            number = layout.options.node
            self.nodes[number] = Node(
                self.bus,
                layout.options,
                f"I/O module (node {number})",
                _IO,
                layout.dictionary,
                self.options,
                self.emergencies,
                self.clock,
            )


def _interpolation_period(period_s: float) -> tuple[int, int]:
    """Object 0x60C2: value (1 byte) and power of ten, as exactly as they go."""
    for exponent in range(-6, 1):
        value = period_s / 10.0**exponent
        if value <= 255 and math.isclose(value, round(value), rel_tol=1e-6):
            return round(value), exponent
    return max(1, min(255, round(period_s * 1000))), -3
