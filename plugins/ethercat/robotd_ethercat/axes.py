"""Axis driver: the CiA 402 axes of the bus."""

from __future__ import annotations

from robotd.api import FloatArray, ProcessImage
from robotd_cia402.axes import Cia402Axes
from robotd_ethercat.master import Master


class EthercatAxes(Cia402Axes):
    """All axes of one bus."""

    def __init__(self, master: Master) -> None:
        super().__init__(master.axes, master.clock)
        self._master = master

    def read(self, image: ProcessImage) -> None:
        self._master.read(image)

    def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
        self._master.stream(position.tolist(), velocity.tolist(), due_ns)

    def on_stream_begun(self) -> None:
        self._master.begin_stream()

    def settle(self) -> None:
        self._master.settle()
