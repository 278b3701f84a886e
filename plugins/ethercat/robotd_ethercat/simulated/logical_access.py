"""Logical datagrams: copies between frame and slaves, planned once for each layout."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

from robotd_ethercat.simulated import registers as reg
from robotd_ethercat.simulated.slave_controller import SlaveController
from robotd_ethercat.simulated.sync_manager import BitRange, SyncManager, copy_bits

_MAX_PLANS = 256  # a master uses a few layouts; random frames must not fill the memory


@dataclass
class LogicalPlan:
    """Effect of a logical datagram at one place of the frame buffer.

    Attributes:
        copies: target and source, in order; a source that is a function does the copy itself.
        working_counter: sum of the increments.
        written: slaves and SyncManagers of which the last byte is written.
    """

    copies: list[tuple[memoryview, memoryview | Callable[[], None]]] = field(default_factory=list)
    working_counter: int = 0
    written: list[tuple[SlaveController, SyncManager]] = field(default_factory=list)

    def run(self, now_ns: int) -> int:
        """Copy, and return the increment of the working counter."""
        for target, source in self.copies:
            if isinstance(source, memoryview):
                target[:] = source
            else:
                source()
        for controller, manager in self.written:
            controller.written(manager, now_ns)
        return self.working_counter


class LogicalAccess:
    """Plans of the logical datagrams of a line, cached until the configuration changes.

    Args:
        buffer: the frame buffer; plans hold slices of it.
    """

    def __init__(self, buffer: memoryview) -> None:
        self._buffer = buffer
        self._plans: dict[tuple[int, ...], LogicalPlan] = {}

    def clear(self) -> None:
        """Forget the plans: FMMUs, SyncManagers or cables changed."""
        self._plans.clear()

    def plan(
        self,
        slaves: Sequence[SlaveController],
        place: int,
        address: int,
        length: int,
        *,
        reads: bool,
        writes: bool,
    ) -> LogicalPlan:
        """Return the plan of a datagram with data at ``place`` of the buffer.

        ``slaves`` are neighbours on the line: a frame may pass a part of it.
        """
        passed = (id(slaves[0]), len(slaves)) if slaves else (0, 0)
        key = (*passed, place, address, length, reads, writes)
        found = self._plans.get(key)
        if found is None:
            if len(self._plans) >= _MAX_PLANS:
                self._plans.clear()
            data = self._buffer[place : place + length]
            found = self._plans[key] = LogicalPlan()
            for slave in slaves:
                _add_slave(found, slave, data, address, reads=reads, writes=writes)
        return found


def _add_slave(
    plan: LogicalPlan,
    slave: SlaveController,
    data: memoryview,
    address: int,
    *,
    reads: bool,
    writes: bool,
) -> None:
    """Add the copies of one slave: outputs first, as inputs may replace them."""
    memory = memoryview(slave.memory)
    fmmus = [(fmmu, fmmu.overlap(address, len(data))) for fmmu in slave.fmmus()]
    read = written = False
    for fmmu, part in fmmus:
        if part is not None and writes and fmmu.writes and _allowed(plan, slave, part, write=True):
            written = True
            plan.copies.append(_copy(memory, part.in_memory, data, part.in_datagram, part))
    for fmmu, part in fmmus:
        if part is not None and reads and fmmu.reads and _allowed(plan, slave, part, write=False):
            read = True
            plan.copies.append(_copy(data, part.in_datagram, memory, part.in_memory, part))
    plan.working_counter += int(read) + int(written) * (2 if reads else 1)


def _allowed(plan: LogicalPlan, slave: SlaveController, part: BitRange, *, write: bool) -> bool:
    """Check SyncManagers and memory; note a SyncManager whose last byte is written."""
    first, end = part.in_memory // 8, (part.in_memory + part.count + 7) // 8
    if end > reg.MEMORY_SIZE:
        return False
    if first < reg.PROCESS_RAM:  # registers: read only, such as the status of a mailbox
        return not write
    for manager in slave.sync_managers:
        if manager.length and manager.start <= first < manager.end:
            if not manager.active or manager.mailbox or manager.to_slave is not write:
                return False
            if write and end >= manager.end:
                plan.written.append((slave, manager))
    return True


def _copy(
    target: memoryview, target_bit: int, source: memoryview, source_bit: int, part: BitRange
) -> tuple[memoryview, memoryview | Callable[[], None]]:
    if part.in_bytes:
        size = part.count // 8
        into = target[target_bit // 8 : target_bit // 8 + size]
        return into, source[source_bit // 8 : source_bit // 8 + size]
    return target, partial(copy_bits, target, target_bit, source, source_bit, part.count)
