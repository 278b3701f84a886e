"""A drive of these tests with its clock and its frames, without a bus or a process."""

from __future__ import annotations

import struct
from typing import Any

import can
import pytest
from tests.plugins.independent.canopen_objects import Abort
from tests.plugins.independent.cia402_node import ServoDrive, State
from tests.plugins.independent.knobs import Knobs

NODE = 5
TURN = 65_536


class Bench:
    """Drive with the clock and the frames of the test."""

    def __init__(self, **knobs: Any) -> None:
        self.frames: list[can.Message] = []
        self.drive = ServoDrive(NODE, self.frames.append, Knobs(**knobs))
        self.now = 0.0

    def wait(self, seconds: float) -> None:
        for _ in range(max(round(seconds * 1000), 1)):
            self.now += 1e-3
            self.drive.tick(self.now)

    def send(self, can_id: int, data: bytes = b"", remote: bool = False) -> None:
        self.drive.receive(
            can.Message(
                arbitration_id=can_id, data=data, is_extended_id=False, is_remote_frame=remote
            ),
            self.now,
        )

    def sent(self, can_id: int) -> list[bytes]:
        """Return the data of all frames of one CAN-ID, and forget them."""
        found = [bytes(frame.data) for frame in self.frames if frame.arbitration_id == can_id]
        self.frames[:] = [frame for frame in self.frames if frame.arbitration_id != can_id]
        return found

    def request(self, data: bytes) -> bytes:
        self.send(0x600 + NODE, data.ljust(8, b"\0"))
        [response] = self.sent(0x580 + NODE)
        if response[0] == 0x80:
            raise Abort(int.from_bytes(response[4:], "little"))
        return response

    def write(self, index: int, sub: int, value: int, size: int = 4) -> None:
        data = (value & (1 << 8 * size) - 1).to_bytes(size, "little")
        command = 0x23 | (4 - size) << 2
        assert self.request(struct.pack("<BHB", command, index, sub) + data)[0] == 0x60

    def read(self, index: int, sub: int = 0) -> int:
        response = self.request(struct.pack("<BHB", 0x40, index, sub))
        return int.from_bytes(response[4 : 8 - (response[0] >> 2 & 3)], "little")

    def nmt(self, command: int) -> None:
        self.send(0, bytes([command, NODE]))

    def control(self, *words: int) -> None:
        for word in words:
            self.write(0x6040, 0, word, 2)
            self.wait(0.001)

    def enable(self, mode: int) -> None:
        self.write(0x6060, 0, mode, 1)
        self.control(0x06, 0x07, 0x0F)
        assert self.drive.power is State.ENABLED


def abort_of(bench: Bench, data: bytes) -> int:
    with pytest.raises(Abort) as aborted:
        bench.request(data)
    return aborted.value.code


def rejected(bench: Bench, index: int, sub: int, value: int, size: int = 4) -> int:
    with pytest.raises(Abort) as aborted:
        bench.write(index, sub, value, size)
    return aborted.value.code


def moving(bench: Bench, speed: int = TURN) -> None:
    bench.enable(9)
    bench.write(0x60FF, 0, speed)
    bench.wait(0.1)
    assert bench.drive.axis.velocity == pytest.approx(speed, rel=0.01)


def booted() -> Bench:
    """A drive that has come to pre-operational."""
    bench = Bench()
    bench.wait(0.1)
    return bench
