"""Fake clock, and fake drivers that execute at once and record every call.

Each driver has ``calls``, a list of tuples: the name of the method, then its arguments.
``failures`` maps the name of a method to the error that it raises instead of obeying.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS
from robotd.device.bus_status import BusNode, BusState, BusStatus
from robotd.device.drivers import (
    AxisDriver,
    DeviceDriver,
    FieldbusDriver,
    IoDriver,
)
from robotd.device.process_image import ProcessImage
from robotd.device.speed_scale import SpeedScale
from robotd.device.state import CommandMode, ConnectionState, Operation
from robotd.motion.profile import Profile

Call = tuple[object, ...]


class FakeClock:
    """Clock for tests: it advances by ``advance``, or when a thread sleeps on it.

    Any thread may call. Sleeping advances the time of all threads, so use it from one thread
    where the order of events matters.
    """

    def __init__(self, start_ns: int = NANOSECONDS) -> None:
        self._now_ns = start_ns
        self._lock = threading.Lock()

    def now_ns(self) -> int:
        return self._now_ns

    def advance(self, seconds: float) -> None:
        """Move time forward by ``seconds`` (>= 0)."""
        with self._lock:
            self._now_ns += round(seconds * NANOSECONDS)

    def sleep_until_ns(self, deadline_ns: int) -> None:
        with self._lock:
            self._now_ns = max(self._now_ns, deadline_ns)


class Recorder:
    """Records calls and raises configured errors."""

    def __init__(self) -> None:
        self.calls: list[Call] = []
        self.failures: dict[str, Exception] = {}

    def record(self, name: str, *arguments: object) -> None:
        """Record a call. Raises the error that ``failures`` has for ``name``."""
        self.calls.append((name, *arguments))
        if name in self.failures:
            raise self.failures[name]


class FakeDevice(Recorder, DeviceDriver):
    """Fake device that changes its state at once.

    Args:
        failing_opens: how many times ``open`` raises ``failures["open"]`` before it works; None
            for ever.

    Attributes:
        note: what ``load_parameters`` returns.
    """

    def __init__(self, failing_opens: int | None = None) -> None:
        super().__init__()
        self.current = ConnectionState.IDLE
        self.failing_opens = failing_opens
        self.note = ""

    def open(self, path: str = "", name: str = "") -> None:
        opened = sum(call[0] == "open" for call in self.calls)
        if opened == self.failing_opens:
            self.failures.pop("open", None)
        self.record("open", path, name)
        self.current = ConnectionState.RUNNING

    def close(self) -> None:
        self.record("close")
        self.current = ConnectionState.IDLE

    def start_communication(self, timeout_s: float) -> None:
        self.record("start_communication", timeout_s)
        self.current = ConnectionState.COMMUNICATING

    def stop_communication(self, timeout_s: float) -> None:
        self.record("stop_communication", timeout_s)
        self.current = ConnectionState.RUNNING

    def state(self) -> ConnectionState:
        return self.current

    def scan_network(self) -> str:
        self.record("scan_network")
        return "a fake network"

    def load_parameters(self, path: Path) -> str:
        self.record("load_parameters", path)
        return self.note

    def dump_parameters(self, axis: int) -> str:
        self.record("dump_parameters", axis)
        return f"parameters of axis {axis}"


class FakeAxes(Recorder, AxisDriver):
    """Fake axes that never move by themselves; ``read`` copies from ``image``.

    A servo obeys at once, ``stream`` becomes the position, and a move only sets ``operation``:
    a test changes the arrays of ``image`` to make the axes do what it needs.
    """

    def __init__(self, axes: int) -> None:
        super().__init__()
        self.image = ProcessImage(axes)
        for array in (
            self.image.position,
            self.image.velocity,
            self.image.torque,
            self.image.position_command,
            self.image.velocity_command,
        ):
            array[:] = 0.0
        self.image.offline[:] = False

    def read(self, image: ProcessImage) -> None:
        for name, value in vars(self.image).items():
            if isinstance(value, np.ndarray):
                getattr(image, name)[:] = value
        image.reason[:] = self.image.reason
        image.fresh_ns, image.shift_ns = self.image.fresh_ns, self.image.shift_ns

    def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
        streaming = self.image.operation == Operation.STREAM
        for mine, theirs in (
            (self.image.position_command, position),
            (self.image.velocity_command, velocity),
            (self.image.position, position),
        ):
            mine[streaming] = theirs[streaming]

    def begin_stream(self, axes: Sequence[int]) -> None:
        self.record("begin_stream", list(axes))
        self.image.operation[list(axes)] = Operation.STREAM

    def end_stream(self, axes: Sequence[int]) -> None:
        self.record("end_stream", list(axes))
        self.image.operation[list(axes)] = Operation.IDLE

    def follow(self, axes: Sequence[int], times_s: FloatArray, positions: FloatArray) -> None:
        self.record("follow", list(axes), times_s, positions)
        self.image.operation[list(axes)] = Operation.STREAM
        self.image.motion_complete[list(axes)] = False

    def servo(self, axis: int, on: bool, timeout_s: float) -> None:
        self.record("servo", axis, on, timeout_s)
        self.image.servo_on[axis] = on

    def clear_alarm(self, axis: int, timeout_s: float) -> None:
        self.record("clear_alarm", axis, timeout_s)
        self.image.amp_alarm[axis], self.image.alarm_code[axis] = False, 0

    def set_command_mode(self, axis: int, mode: CommandMode) -> None:
        self.record("set_command_mode", axis, mode)
        self.image.mode[axis] = mode

    def set_polarity(self, axis: int, polarity: int) -> None:
        self.record("set_polarity", axis, polarity)

    def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
        self.record("set_gear_ratio", axis, numerator, denominator)

    def home(self, axis: int, timeout_s: float) -> None:
        self.record("home", axis, timeout_s)
        self.image.home_done[axis] = True

    def move(self, axis: int, target: float, profile: Profile) -> None:
        self.record("move", axis, target, profile)
        self.image.operation[axis] = Operation.POSITION

    def jog(self, axis: int, profile: Profile) -> None:
        self.record("jog", axis, profile)
        self.image.operation[axis] = Operation.VELOCITY if profile.velocity else Operation.IDLE

    def stop(self, axes: Sequence[int]) -> None:
        self.record("stop", list(axes))
        self.image.operation[list(axes)] = Operation.IDLE

    def quick_stop(self, axes: Sequence[int]) -> None:
        self.record("quick_stop", list(axes))
        self.image.operation[list(axes)] = Operation.IDLE


class FakeIo(Recorder, IoDriver):
    """Fake I/O on two byte arrays that a test may change: ``inputs`` and ``outputs``."""

    def __init__(self, input_bytes: int = 8, output_bytes: int = 8) -> None:
        super().__init__()
        self.inputs = bytearray(input_bytes)
        self.outputs = bytearray(output_bytes)

    @property
    def input_bytes(self) -> int:
        return len(self.inputs)

    @property
    def output_bytes(self) -> int:
        return len(self.outputs)

    def read_inputs(self, byte: int, length: int) -> bytes:
        return bytes(self.inputs[byte : byte + length])

    def read_outputs(self, byte: int, length: int) -> bytes:
        return bytes(self.outputs[byte : byte + length])

    def write_outputs(self, byte: int, data: bytes) -> None:
        self.record("write_outputs", byte, data)
        self.outputs[byte : byte + len(data)] = data

    def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
        self.record("write_output_bit", byte, bit, value)
        mask = 1 << bit
        self.outputs[byte] = self.outputs[byte] | mask if value else self.outputs[byte] & ~mask


class FakeFieldbus(Recorder, FieldbusDriver):
    """One bus with ``nodes``; a register holds the low byte of its address."""

    def __init__(self, nodes: int = 2) -> None:
        super().__init__()
        made = tuple(BusNode(number, BusState.OPERATIONAL) for number in range(nodes))
        self.network = BusStatus(BusState.OPERATIONAL, nodes=made)
        self.objects: dict[tuple[int, int, int], bytes] = {}

    @property
    def buses(self) -> int:
        return 1

    @property
    def register_bytes(self) -> int:
        return 0x1000

    def status(self, bus: int) -> BusStatus:
        return self.network

    def read_register(self, bus: int, node: int, address: int, length: int) -> bytes:
        self.record("read_register", bus, node, address, length)
        return bytes(number % 256 for number in range(address, address + length))

    def reset_statistics(self, bus: int) -> None:
        self.record("reset_statistics", bus)

    def start_hot_connect(self, bus: int) -> None:
        self.record("start_hot_connect", bus)

    def read_object(self, bus: int, node: int, index: int, subindex: int) -> bytes:
        self.record("read_object", bus, node, index, subindex)
        return self.objects.get((node, index, subindex), bytes(4))

    def write_object(self, bus: int, node: int, index: int, subindex: int, data: bytes) -> None:
        self.record("write_object", bus, node, index, subindex, data)
        self.objects[node, index, subindex] = data


def streaming_axes(extrapolation_s: float, buffer_s: float) -> Any:
    """The parts of ``Axes`` that a streamed trajectory uses."""
    return SimpleNamespace(
        speed=SpeedScale(),
        extrapolation_s=extrapolation_s,
        stream_buffer_s=buffer_s,
        feedback_period_s=0.0,
        response_s=0.0,
    )
