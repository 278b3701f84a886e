"""Master for tests: datagrams through a line of simulated slaves, on a clock of its own."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

from robotd_ethercat.simulated import GenericSlave, Line, Port, Slave
from robotd_ethercat.simulated import registers as reg
from robotd_ethercat.simulated.datagrams import Command

INIT, PRE_OP, SAFE_OP, OP, ACKNOWLEDGE = 1, 2, 4, 8, 16
START_NS = 1_000_000_000
LOGICAL = 0x10000
MAILBOX = 256
OUTBOX, INBOX = 0x1000, 0x1400  # of the slave: written and read by the master
OUTPUTS, INPUTS = 0x1800, 0x2400


@dataclass
class Reply:
    """Datagram as it came back."""

    data: bytes
    counter: int
    address: int


def datagram(command: int, address: int, offset: int, data: bytes, *, more: bool = False) -> bytes:
    flags = len(data) | (0x8000 if more else 0)
    head = struct.pack("<BBHHHH", command, 0, address & 0xFFFF, offset, flags, 0)
    return head + data + bytes(2)


def frame_of(*datagrams: tuple[int, int, int, bytes]) -> bytes:
    body = b"".join(
        datagram(*one, more=number < len(datagrams) - 1) for number, one in enumerate(datagrams)
    )
    header = struct.pack("<H", len(body) | 0x1000)
    return bytes.fromhex("ffffffffffff 010101010101 88a4") + header + body


class LineMaster:
    """Master of ``line``; ``now_ns`` advances by ``wait`` alone."""

    def __init__(self, line: Line) -> None:
        self.line = line
        self.now_ns = START_NS
        self._counter = 0

    def send(self, frame: bytes, port: Port = Port.PRIMARY) -> bytes | None:
        """Send a whole frame; return it as it comes back, None if it is lost."""
        self.line.buffer[: len(frame)] = frame
        leaves = self.line.forward(len(frame), self.now_ns, port)
        answer = bytes(self.line.buffer[: len(frame)])
        self.line.service(self.now_ns)
        return answer if leaves is not None else None

    def exchange(self, *datagrams: tuple[int, int, int, bytes]) -> list[Reply] | None:
        answer = self.send(frame_of(*datagrams))
        if answer is None:
            return None
        replies, position = [], 16
        for *_, data in datagrams:
            address = struct.unpack_from("<H", answer, position + 2)[0]
            end = position + 10 + len(data)
            counter = struct.unpack_from("<H", answer, end)[0]
            replies.append(Reply(answer[position + 10 : end], counter, address))
            position = end + 2
        return replies

    def do(self, command: int, address: int, offset: int, data: bytes) -> Reply:
        """Exchange one datagram, which must come back."""
        replies = self.exchange((command, address, offset, data))
        assert replies is not None
        return replies[0]

    def read(self, slave: int, register: int, length: int = 2) -> int:
        """Read a register by position."""
        reply = self.do(Command.APRD, -slave, register, bytes(length))
        assert reply.counter == 1
        return int.from_bytes(reply.data, "little")

    def write(self, slave: int, register: int, data: bytes) -> int:
        """Write memory by position; return the working counter."""
        return self.do(Command.APWR, -slave, register, data).counter

    def logical(self, command: int, address: int, data: bytes) -> Reply:
        return self.do(command, address & 0xFFFF, address >> 16, data)

    def wait(self, seconds: float, step: float = 0.005) -> None:
        """Let time pass, with the ticks of the bus."""
        end_ns = self.now_ns + round(seconds * 1e9)
        while self.now_ns < end_ns:
            self.now_ns = min(end_ns, self.now_ns + round(step * 1e9))
            self.line.tick(self.now_ns)

    def request(self, slave: int, control: int) -> tuple[int, int]:
        """Request an AL state; return AL status and AL status code."""
        self.write(slave, reg.AL_CONTROL, control.to_bytes(2, "little"))
        return self.read(slave, reg.AL_STATUS), self.read(slave, reg.AL_STATUS_CODE)

    def sync_manager(self, slave: int, number: int, start: int, length: int, control: int) -> None:
        data = struct.pack("<HHBBBB", start, length, control, 0, int(length > 0), 0)
        self.write(slave, reg.SYNC_MANAGER + 8 * number, data)

    def fmmu(
        self, slave: int, number: int, logical: int, memory: int, kind: int, length: int = 8
    ) -> None:
        data = struct.pack("<IHBBHBBB3x", logical, length, 0, 7, memory, 0, kind, 1)
        self.write(slave, reg.FMMU + 16 * number, data)

    def pre_op(self, slave: int) -> None:
        self.sync_manager(slave, 0, OUTBOX, MAILBOX, 0x26)
        self.sync_manager(slave, 1, INBOX, MAILBOX, 0x22)
        assert self.request(slave, PRE_OP) == (PRE_OP, 0)

    def safe_op(self, slave: int, out_bytes: int = 8, in_bytes: int = 8) -> None:
        """Configure process data: outputs at LOGICAL + 8 × slave, inputs at the same place."""
        self.pre_op(slave)
        self.sync_manager(slave, 2, OUTPUTS, out_bytes, 0x64)
        self.sync_manager(slave, 3, INPUTS, in_bytes, 0x20)
        address = LOGICAL + 8 * slave
        self.fmmu(slave, 0, address, OUTPUTS, 2, out_bytes)
        self.fmmu(slave, 1, address, INPUTS, 1, in_bytes)
        assert self.request(slave, SAFE_OP) == (SAFE_OP, 0)

    def op(self, slave: int) -> None:
        self.safe_op(slave)
        self.write(slave, reg.AL_CONTROL, bytes([OP, 0]))
        self.logical(Command.LRW, LOGICAL + 8 * slave, bytes(8))
        assert self.read(slave, reg.AL_STATUS) == OP

    def mailbox_send(self, slave: int, data: bytes, kind: int = 3) -> int:
        """Write a mailbox message; return the working counter."""
        message = struct.pack("<HHBB", len(data), 0, 0, kind) + data
        return self.write(slave, OUTBOX, message.ljust(MAILBOX, b"\0"))

    def mailbox_receive(self, slave: int) -> tuple[int, bytes] | None:
        """Read the mailbox; return type and data, None if it is empty."""
        if not self.read(slave, reg.SYNC_MANAGER + 8 + 5, 1) & 8:
            return None
        reply = self.do(Command.APRD, -slave, INBOX, bytes(MAILBOX))
        assert reply.counter == 1
        length, _, _, kind = struct.unpack_from("<HHBB", reply.data)
        return kind & 0x0F, reply.data[6 : 6 + length]


def line_of(count: int, *, redundant: bool = False) -> Line:
    return Line([GenericSlave(START_NS) for _ in range(count)], redundant=redundant)


def master_of(slaves: int | Sequence[Slave]) -> LineMaster:
    line = line_of(slaves) if isinstance(slaves, int) else Line(slaves)
    return LineMaster(line)
