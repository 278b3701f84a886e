"""A CiA 402 axis and a simulated drive without a bus between them, on the simulated clock."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any

import pytest

from robotd.api import NANOSECONDS, ProcessImage, Profile
from robotd.clock.simulated import SteppedClock
from robotd_cia402.axis import Axis
from robotd_cia402.commands import Commands
from robotd_cia402.drive_access import DriveAccess, SdoAbort
from robotd_cia402.drive_setup import set_up
from robotd_cia402.node import Emergency, FieldbusNode
from robotd_cia402.object_numbers import INPUTS, INTERPOLATION, OUTPUTS, on_axis
from robotd_cia402.options import DriveOptions
from robotd_cia402.scaling import Scaling
from robotd_cia402.simulated import Drive, DriveFaults, Motors, drive_defaults
from robotd_cia402.simulated_axis import drive_model

PERIOD_S = 0.004
PERIOD_NS = round(PERIOD_S * NANOSECONDS)
SUPPORTED_MODES, UNKNOWN_OBJECT = 0x6502, 0x06020000
FAST = Profile(velocity=1.0, acceleration=5.0, deceleration=5.0)


class LoopedObjects(DriveAccess):
    """Objects of a drive in this process; a frame is one ``exchange``."""

    frames = 0
    silence = 0  # frames in a row that the drive has missed

    def __init__(self, axis_offset: int) -> None:
        super().__init__()
        self.node = FieldbusNode("node", 1, "joint1", deque())
        self.node.online = True
        self.inputs, self.outputs = INPUTS, OUTPUTS
        self.dictionary = drive_defaults(axes=2)  # the drive's side
        self.written: list[tuple[int, int, int]] = []
        self._offset = axis_offset
        self._complete = False
        self._sent: Sequence[int] = ()
        self._taken: list[int] = [0] * len(INPUTS)

    @property
    def known(self) -> bool:
        return self.node.online and self._complete

    @property
    def answered(self) -> int:
        return self.frames

    def put(self, values: Sequence[int]) -> None:
        self._sent = values

    def values(self) -> Sequence[int]:
        return self._taken

    def has(self, index: int) -> bool:
        return (on_axis(index, self._offset), 0) in self.dictionary

    def read(self, index: int, sub: int = 0) -> int:
        key = on_axis(index, self._offset), sub
        if key not in self.dictionary:
            raise SdoAbort(f"{self.node.label}: no object 0x{index:04X}", UNKNOWN_OBJECT)
        return self.dictionary[key]

    def write(self, index: int, sub: int, value: int) -> None:
        self.written.append((index, sub, value))
        self.dictionary[on_axis(index, self._offset), sub] = value

    @property
    def awaited(self) -> str:
        return "nothing received yet"

    def writable(self, index: int, sub: int) -> bool:
        return self.has(index)

    def forget(self) -> None:
        self._complete = False

    @property
    def missed(self) -> int:
        return self.silence

    def send(self) -> None:
        """Outputs as the frame carries them, interpolation data at subindex 1."""
        for index, value in zip(OUTPUTS, self._sent, strict=False):  # none before the first
            sub = 1 if index == INTERPOLATION else 0
            self.dictionary[on_axis(index, self._offset), sub] = value
        self.frames += 1

    def take(self) -> None:
        self._taken = [self.dictionary[on_axis(index, self._offset), 0] for index in INPUTS]
        self._complete = True


class LoopedDrive:
    """An axis, its commands and its drive; sleeping on ``clock`` exchanges frames.

    Attributes:
        deaf: the drive gets no frames, and answers none.
        mute: it gets them, and its answers are lost.
    """

    def __init__(self, **options: Any) -> None:
        section = DriveOptions.model_validate({"axis": 0, "counts_per_rad": 1e5, **options})
        self.clock = SteppedClock()
        self.objects = LoopedObjects(section.axis_offset)
        self.axis: Axis[LoopedObjects] = Axis(
            section, self.objects, Scaling(section, rated_torque_nm=50.0)
        )
        self.commands = Commands(self.axis, self.clock)
        self.image = ProcessImage(1)
        self.faults = DriveFaults()
        self.motors = Motors([0.0], self.clock.now_ns())
        self.drive = Drive(
            drive_model(0, section, 50.0),
            self.objects.dictionary,
            self.motors,
            self.faults,
            self._on_emergency,
        )
        self.deaf = self.mute = False
        self.drive.power_on()
        set_up(self.axis, PERIOD_S)
        self.clock.attach(PERIOD_NS, self._period)

    def run(self, seconds: float) -> None:
        self.clock.sleep_until_ns(self.clock.now_ns() + round(seconds * NANOSECONDS))

    def _period(self, due_ns: int) -> int:
        if self.deaf:
            self.objects.frames += 1
            self.objects.silence += 1
        elif self.objects.node.online:
            self._exchange()
        self.axis.observe(self.image)
        self.axis.transmit(PERIOD_S)
        return due_ns + PERIOD_NS

    def _exchange(self) -> None:
        self.motors.synchronise(self.clock.now_ns(), PERIOD_S)
        self.drive.sample(PERIOD_S)
        self.objects.send()
        self.drive.sync(PERIOD_S)
        if self.mute:
            self.objects.silence += 1
        else:
            self.objects.take()
            self.objects.silence = 0

    def _on_emergency(self, code: int, register: int) -> None:
        emergency = Emergency(self.clock.now_ns(), 1, code, register, bytes(5))
        self.objects.node.emergency = None if emergency.is_reset else emergency


def idle(looped: LoopedDrive, limit_s: float = 5.0) -> None:
    """Run until the axis has no operation."""
    periods = round(limit_s / 0.02)
    for _ in range(periods):
        looped.run(0.02)
        if looped.axis.activity.is_idle:
            return
    pytest.fail(f"still {looped.axis.activity.operation.name} after {limit_s} s")


def peak_velocity(looped: LoopedDrive, periods: int = 250) -> float:
    """Return the largest velocity of the motor while it runs; an axis at rest does not jump."""
    velocities = []
    for _ in range(periods):
        looped.run(0.004)
        velocities.append(abs(looped.motors.velocity(0)))
    return max(velocities)
