"""I/O driver over the simulated image."""

from __future__ import annotations

from robotd.api import ConnectionState, InvalidArgument, IoDriver, NotReady
from robotd_sim.options import IMAGE_BYTES
from robotd_sim.simulation import Simulation


class SimIo(IoDriver):
    """I/O of the simulated device: reads always work, writes need an open device."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation

    @property
    def input_bytes(self) -> int:
        return IMAGE_BYTES

    @property
    def output_bytes(self) -> int:
        return IMAGE_BYTES

    @property
    def live(self) -> tuple[memoryview, memoryview]:
        return memoryview(self._simulation.io.inputs), memoryview(self._simulation.io.outputs)

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
