"""Simulated network: one thread and one CAN bus with all nodes."""

from __future__ import annotations

import heapq
import logging
import queue
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Self

import can
import canopen

from robotd.api import NANOSECONDS, request_realtime
from robotd_canopen.frame import Frame
from robotd_canopen.simulated.simulated_node import OPERATIONAL, Faults, SimulatedNode
from robotd_cia402.simulated.drive import Drive, DriveModel
from robotd_cia402.simulated.motors import Motors

log = logging.getLogger(__name__)

_SYNC, _NMT, _HEARTBEAT = 0x080, 0x000, 0x700
_NODE = 0x7F  # bits of a COB-ID that hold the node, in the predefined connection set
_RPDOS = range(0x180, 0x580)
_STEP_NS = 10_000_000  # period of heartbeats and supervision without traffic
_LATEST_NS = 10 * _STEP_NS  # the same under any traffic
_LONGEST_WAIT_S = 5.0  # a longer wait means that the clock of the computer was set
_SYNC_LOST_NS = 100_000_000  # without SYNC for so long the drives run on the clock of the computer

Action = Callable[[], None]
_OUTPUTS, _INPUTS = 0x6200, 0x6000
_MAX_BYTES = 8
_OVER_VOLTAGE = 0x3210
_CONTROLWORD, _AXIS_STEP = 0x6040, 0x800  # of one axis of a drive to the next


class DriveNode(SimulatedNode):
    """A drive with one axis or several, each with its motor in ``machine``."""

    def __init__(
        self,
        node_id: int,
        eds: Path,
        machine: Motors,
        models: Sequence[DriveModel],
        identity: dict[int, int] | None = None,
    ) -> None:
        super().__init__(node_id, eds, identity)
        self.drives = [
            Drive(model, self.values, machine, self.faults, self.emergency) for model in models
        ]
        for drive in self.drives:
            drive.power_on()

    def boot(self, now_ns: int) -> None:
        super().boot(now_ns)
        for drive in self.drives:
            drive.power_on()

    def sync(self, period_s: float) -> None:
        """Act on the synchronous objects, which have taken effect."""
        if self.state == OPERATIONAL:
            for drive in self.drives:
                drive.sync(period_s)

    def sample(self, period_s: float) -> None:
        for drive in self.drives:
            drive.sample(period_s)

    def on_event(self) -> None:
        self.sync(0.001)

    def on_written(self, index: int, sub: int) -> None:
        """A controlword by SDO; an operational node takes it with the next SYNC."""
        if index % _AXIS_STEP == _CONTROLWORD % _AXIS_STEP and self.state != OPERATIONAL:
            for drive in self.drives:
                drive.sync(0.001)

    def on_connection_lost(self) -> None:
        for drive in self.drives:
            drive.connection_lost()

    def trip(self, code: int = _OVER_VOLTAGE) -> None:
        """A fault of the power stage on all axes."""
        for drive in self.drives:
            drive.trip(code)


class IoNode(SimulatedNode):
    """A CiA 401 module. With ``loopback`` its inputs are wired to its outputs."""

    def __init__(
        self,
        node_id: int,
        eds: Path,
        identity: dict[int, int] | None = None,
        *,
        loopback: bool = False,
    ) -> None:
        self.loopback = loopback
        super().__init__(node_id, eds, identity)

    @property
    def outputs(self) -> bytes:
        """The output bytes as they are now."""
        return bytes(self.values[_OUTPUTS, sub] for sub in range(1, _MAX_BYTES + 1))

    def set_input(self, byte: int, value: int) -> None:
        """An input byte of the module changes."""
        self.values[_INPUTS, byte + 1] = value
        self._report()

    def set_input_bit(self, byte: int, bit: int, *, value: bool) -> None:
        """One input of the module changes."""
        before = self.values[_INPUTS, byte + 1]
        self.set_input(byte, before & ~(1 << bit) | int(value) << bit)

    def on_event(self) -> None:
        if self.loopback:
            for sub in range(1, _MAX_BYTES + 1):
                self.values[_INPUTS, sub] = self.values[_OUTPUTS, sub]
        self._report()

    def on_written(self, index: int, sub: int) -> None:
        if index == _OUTPUTS:
            self.on_event()

    def on_operational(self) -> None:
        self._report(always=True)

    def _report(self, *, always: bool = False) -> None:
        if self.state == OPERATIONAL:
            for cob_id, data in self.pdos.changed(always=always):
                self.send(cob_id, data)


class SimulatedNetwork(canopen.Network):
    """Nodes that share a bus and a thread; started by ``start`` or as a context.

    Any thread may read nodes; ``call`` runs changes in the thread of the network.

    Args:
        bus: an open python-can bus; closed by ``stop``.
        nodes: drives and modules, not connected to another network.
        machine: the motors of the drives.
        realtime_priority: SCHED_FIFO priority of the thread, where it is granted; 0: none.
    """

    def __init__(
        self,
        bus: can.BusABC,
        nodes: Sequence[SimulatedNode],
        machine: Motors | None = None,
        *,
        realtime_priority: int = 0,
    ) -> None:
        super().__init__(bus)
        self._bus = bus
        self.members: Mapping[int, SimulatedNode] = {node.number: node for node in nodes}
        self._machine = machine or Motors([], time.monotonic_ns())
        self._calls: queue.SimpleQueue[Action] = queue.SimpleQueue()
        self._delayed: list[tuple[int, int, int, bytes, Faults]] = []
        self._count = 0
        self._priority = realtime_priority
        self._sync_ns = 0
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="canopen-simulated", daemon=True)
        self._drives = [node for node in nodes if isinstance(node, DriveNode)]
        for node in nodes:
            node.connect(self, partial(self._send, node))

    def start(self) -> None:
        """Power on: all nodes boot."""
        self._thread.start()
        self.call(self._boot)

    def stop(self) -> None:
        """End the thread and close the bus. Twice is not an error."""
        self._ending.set()
        if self._thread.is_alive():
            self._thread.join(5.0)
        if self.bus is not None:
            self.bus.shutdown()
            self.bus = None

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def call(self, action: Action, timeout_s: float = 5.0) -> None:
        """Run ``action`` in the network's thread and wait for it. Raises what it raises."""
        done = threading.Event()
        failures: list[Exception] = []

        def run() -> None:
            try:
                action()
            except Exception as error:  # noqa: BLE001 - handed to the caller
                failures.append(error)
            done.set()

        self._calls.put(run)
        if not done.wait(timeout_s):
            raise TimeoutError(f"the simulated network did not run the call within {timeout_s:g} s")
        if failures:
            raise failures[0]

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send a frame; called by the SDO servers of the library."""
        self._put(can_id, self.members[can_id & _NODE].faults.garble(data))

    def _boot(self) -> None:
        for node in self.members.values():
            node.boot(time.monotonic_ns())

    def _run(self) -> None:
        request_realtime(self._priority)
        due_ns = 0
        while not self._ending.is_set():
            now_ns = time.monotonic_ns()
            while not self._calls.empty():
                self._calls.get()()
            wait_ns = due_ns - now_ns
            if self._delayed:
                wait_ns = min(wait_ns, self._delayed[0][0] - now_ns)
            try:
                message = self._bus.recv(max(0.0, wait_ns / NANOSECONDS))
                if message is not None:
                    self._receive(message)
                self._send_delayed()
                # Read waiting frames first: after a pause of the computer the master is not silent.
                over_ns = time.monotonic_ns() - due_ns
                if over_ns >= 0 and (message is None or over_ns > _LATEST_NS):
                    due_ns = self._tick() + _STEP_NS
            except Exception as error:  # noqa: BLE001 - no frame may end the thread
                if self._ending.wait(0.001):
                    return
                log.warning("the simulated network: %s: %s", type(error).__name__, error)

    def _receive(self, message: can.Message) -> None:
        if message.is_error_frame or message.is_remote_frame or message.is_extended_id:
            return
        cob_id, data, now_ns = message.arbitration_id, bytes(message.data), _arrival_ns(message)
        if cob_id == _SYNC:
            self._sync(now_ns)
        elif cob_id in _RPDOS:
            for node in self.members.values():
                node.on_rpdo(cob_id, data)
        elif cob_id == _NMT and len(data) >= 2:
            for node in self.members.values():
                node.on_nmt(data, now_ns)
        elif cob_id >= _HEARTBEAT:
            for node in self.members.values():
                node.on_heartbeat_of(cob_id & 0x7F, now_ns)
        else:
            for handler in self.subscribers.get(cob_id, ()):
                handler(cob_id, bytearray(data), message.timestamp)

    def _sync(self, now_ns: int) -> None:
        period_s = self._period_s()
        self._sync_ns = now_ns
        self._machine.synchronise(now_ns, period_s)
        nodes = self.members.values()
        for drive in self._drives:
            drive.sample(period_s)
        for node in nodes:
            node.before_sync(now_ns)
        for drive in self._drives:
            if not drive.faults.silent:
                drive.sync(period_s)
        for node in nodes:
            node.after_sync()

    def _tick(self) -> int:
        now_ns = time.monotonic_ns()
        if now_ns - self._sync_ns > _SYNC_LOST_NS:
            self._machine.free_run(now_ns)
            for drive in self._drives:
                drive.sample(_STEP_NS / NANOSECONDS)
        for node in self.members.values():
            node.tick(now_ns)
        return now_ns

    def _period_s(self) -> float:
        """Interpolation time period (0x60C2) of the first drive: all drives share one SYNC."""
        for node in self._drives:
            value, exponent = node.values.get((0x60C2, 1), 0), node.values.get((0x60C2, 2), -3)
            if value:
                return float(value * 10.0**exponent)
        return 0.004

    def _send(self, node: SimulatedNode, cob_id: int, data: bytes) -> None:
        """Send a frame of ``node``, subject to its faults."""
        faults = node.faults
        if faults.silent:
            return
        if cob_id in _RPDOS:
            if faults.drops_pdo():
                return
            if faults.pdo_delay_s:
                due_ns = time.monotonic_ns() + round(faults.pdo_delay_s * NANOSECONDS)
                self._count += 1
                heapq.heappush(self._delayed, (due_ns, self._count, cob_id, data, faults))
                return
        self._put(cob_id, faults.garble(data))

    def _send_delayed(self) -> None:
        while self._delayed and self._delayed[0][0] <= time.monotonic_ns():
            _, _, cob_id, data, faults = heapq.heappop(self._delayed)
            if faults.pdo_delay_s:  # the end of the fault drops what waits
                self._put(cob_id, data)

    def _put(self, cob_id: int, data: bytes) -> None:
        self._bus.send(Frame(cob_id, data))


def _arrival_ns(message: can.Message) -> int:
    """Return the arrival time, monotonic: the message may have waited for this thread."""
    waited_s = time.time() - message.timestamp if message.timestamp else 0.0
    return time.monotonic_ns() - round(min(max(waited_s, 0.0), _LONGEST_WAIT_S) * NANOSECONDS)
