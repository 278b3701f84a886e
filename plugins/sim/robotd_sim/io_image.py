"""Digital I/O image of the simulated device: 8000 bytes in, 8000 bytes out."""

from __future__ import annotations

from robotd_servo_model import World

IMAGE_BYTES = 8000


class IoImage:
    """The two images. Hold the world's lock. With ``loopback`` outputs are wired to inputs."""

    def __init__(self, world: World, *, loopback: bool) -> None:
        self.inputs, self.outputs = bytearray(IMAGE_BYTES), bytearray(IMAGE_BYTES)
        self._world, self._loopback = world, loopback
        self._stuck: dict[tuple[int, int], bool] = {}

    def stick(self, byte: int, bit: int, value: bool | None) -> None:
        """One output bit keeps ``value`` whatever is written; None: normal again."""
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
