"""Backends whose drivers raise or hang, from the start or on request.

The request is ``broken``, in the same process, or a file, in another: ``ROBOTD_TEST_BREAK`` is
its path, and while it exists they are broken.
"""

from __future__ import annotations

import os
import threading
from pathlib import Path

from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import ProcessImage
from robotd.device.state import ConnectionState
from robotd_sim import SimAxes, SimDevice, SimIo

BREAK = "ROBOTD_TEST_BREAK"


class Switch(threading.Event):
    """An event that is set, too, while the file exists."""

    def is_set(self) -> bool:
        path = os.environ.get(BREAK)
        return super().is_set() or (path is not None and Path(path).exists())


broken = Switch()
released = threading.Event()


class RaisesInRead(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            if broken.is_set():
                raise ZeroDivisionError("no scale")
            super().read(image)


class HangsInRead(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            if broken.is_set():
                released.wait(20.0)
            super().read(image)


class HangsInState(Mutant):
    class Device(SimDevice):
        def state(self) -> ConnectionState:
            if broken.is_set():
                released.wait(20.0)
            return super().state()


class HangsInServo(Mutant):
    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            released.wait(20.0)


class RaisesInServo(Mutant):
    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            raise KeyError("controlword")


class HangsInClose(Mutant):
    class Device(SimDevice):
        def close(self) -> None:
            released.wait(20.0)


class HangsInFault(Mutant):
    """No value is renewed, and the device does not say why."""

    class Device(SimDevice):
        def fault(self) -> str:
            released.wait(20.0)
            return ""

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            if not broken.is_set():
                super().read(image)


class HangsInInputs(Mutant):
    class Io(SimIo):
        def read_inputs(self, byte: int, length: int) -> bytes:
            threading.Event().wait()
            return super().read_inputs(byte, length)


class HangsInWrite(Mutant):
    class Io(SimIo):
        def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
            released.wait(8.0)
