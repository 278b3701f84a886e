"""The digital I/O image of the engine: 8000 bytes in, 8000 bytes out."""

from __future__ import annotations

from typing import TYPE_CHECKING

from robotd.api import ConnectionState, InvalidArgument, IoDriver, NotReady
from robotd_sim.world import World

if TYPE_CHECKING:
    from robotd_sim.simulation import Simulation

IMAGE_BYTES = 8000


class IoImage:
    """The two images. Hold the world's lock. With ``loopback`` outputs are wired to inputs."""

    def __init__(self, world: World, *, loopback: bool) -> None:
        self.inputs, self.outputs = bytearray(IMAGE_BYTES), bytearray(IMAGE_BYTES)
        self._world, self._loopback = world, loopback
        self._stuck: dict[tuple[int, int], bool] = {}

    def stick(self, byte: int, bit: int, value: bool | None) -> None:
        """One output bit keeps ``value`` whatever is written; None: it obeys again."""
        if value is None:
            self._stuck.pop((byte, bit), None)
        else:
            self._stuck[byte, bit] = value
            self._keep_stuck()

    def write(self, byte: int, data: bytes) -> None:
        self.outputs[byte : byte + len(data)] = data
        self._keep_stuck()
        if self._loopback:
            copy = bytes(self.outputs[byte : byte + len(data)])
            self._world.at(self._world.tick + 1, lambda: self._arrive(byte, copy))

    def clear(self) -> None:
        """Both images to zero, as at the end of the engine."""
        self.inputs[:] = self.outputs[:] = bytes(IMAGE_BYTES)
        self._keep_stuck()

    def _keep_stuck(self) -> None:
        for (byte, bit), value in self._stuck.items():
            self.outputs[byte] = self.outputs[byte] & ~(1 << bit) | int(value) << bit

    def _arrive(self, byte: int, data: bytes) -> None:
        self.inputs[byte : byte + len(data)] = data


class SimIo(IoDriver):
    """The images as the contract wants them: reads always answer, writes need an open device."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation

    @property
    def input_bytes(self) -> int:
        return IMAGE_BYTES

    @property
    def output_bytes(self) -> int:
        return IMAGE_BYTES

    def read_inputs(self, byte: int, length: int) -> bytes:
        self._check(byte, length)
        with self._simulation.world.lock:
            self._simulation.world.advance()
            return bytes(self._simulation.io.inputs[byte : byte + length])

    def read_outputs(self, byte: int, length: int) -> bytes:
        self._check(byte, length)
        return bytes(self._simulation.io.outputs[byte : byte + length])

    def write_outputs(self, byte: int, data: bytes) -> None:
        self._check(byte, len(data))
        with self._simulation.world.lock:
            self._simulation.world.advance()
            self._require_open()
            self._simulation.io.write(byte, data)

    def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
        self._check(byte, 1)
        if not 0 <= bit <= 7:
            raise InvalidArgument(f"bit {bit} does not exist, bits are 0 to 7")
        with self._simulation.world.lock:
            self._simulation.world.advance()
            self._require_open()
            others = self._simulation.io.outputs[byte] & ~(1 << bit)
            self._simulation.io.write(byte, bytes([others | (int(value) << bit)]))

    def _require_open(self) -> None:
        if self._simulation.engine is ConnectionState.IDLE:
            raise NotReady("outputs cannot be written: no device is open")

    @staticmethod
    def _check(byte: int, length: int) -> None:
        if byte < 0 or length < 0 or byte + length > IMAGE_BYTES:
            raise InvalidArgument(
                f"bytes {byte} to {byte + length - 1} are outside of the image,"
                f" which has bytes 0 to {IMAGE_BYTES - 1}"
            )
