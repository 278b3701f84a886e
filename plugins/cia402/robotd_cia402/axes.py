"""Axis driver of CiA 402 drives: passes each call to its axes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from robotd.api import (
    AxisDriver,
    Clock,
    CommandMode,
    FloatArray,
    NotReady,
    ProcessImage,
    Profile,
    RobotdError,
    Underrun,
)
from robotd_cia402.axis import Axis
from robotd_cia402.commands import Commands
from robotd_cia402.drive_setup import write_quick_stop_ramp


class Cia402Master(Protocol):
    """Axes of one fieldbus and their exchange; implemented by each backend."""

    @property
    def axes(self) -> Sequence[Axis]:
        """By axis number."""
        ...

    @property
    def clock(self) -> Clock: ...

    def read(self, image: ProcessImage) -> None:
        """Control loop: as ``AxisDriver.read``."""
        ...

    def stream(self, position: Sequence[float], velocity: Sequence[float], due_ns: int) -> None:
        """Control loop: as ``AxisDriver.stream``, with plain numbers."""
        ...

    def stream_torque(self, torque: Sequence[float]) -> None:
        """Control loop: as ``AxisDriver.stream_torque``, with plain numbers."""
        ...

    def begin_stream(self) -> None:
        """Worker: start the time-out of the stream."""
        ...

    def settle(self) -> None:
        """Worker: wait until the process image shows the latest change.

        It returns after some periods where no control loop runs.
        """
        ...


class Cia402Axes(AxisDriver):
    """All axes of one fieldbus."""

    def __init__(self, master: Cia402Master) -> None:
        self._master, self._axes = master, master.axes
        self._commands = [Commands(axis, master.clock) for axis in master.axes]

    def read(self, image: ProcessImage) -> None:
        self._master.read(image)

    def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
        self._master.stream(position.tolist(), velocity.tolist(), due_ns)

    def stream_torque(self, torque: FloatArray, due_ns: int) -> None:
        self._master.stream_torque(torque.tolist())

    @property
    def underrun(self) -> Underrun:
        return Underrun.HOLD  # without frames from the control loop a drive holds its position

    def begin_stream(self, axes: Sequence[int]) -> None:
        for axis in axes:
            self._commands[axis].require_online()
        try:
            for axis in axes:
                self._commands[axis].prepare_stream()
            self._master.begin_stream()
            for axis in axes:
                self._commands[axis].begin_stream()
        except RobotdError:
            self._master.begin_stream()
            for axis in axes:
                self._commands[axis].end_stream()
                self._commands[axis].leave_torque()
            raise
        self._master.settle()

    def end_stream(self, axes: Sequence[int]) -> None:
        for axis in axes:
            self._commands[axis].end_stream()
        self._master.settle()

    def servo(self, axis: int, on: bool, timeout_s: float) -> None:
        commands = self._commands[axis]
        if on:
            commands.enable(timeout_s)
        else:
            commands.disable(timeout_s)
        self._master.settle()

    def clear_alarm(self, axis: int, timeout_s: float) -> None:
        self._commands[axis].clear_alarm(timeout_s)
        self._master.settle()

    def set_command_mode(self, axis: int, mode: CommandMode) -> None:
        self._commands[axis].set_mode(mode)
        self._master.settle()

    def set_polarity(self, axis: int, polarity: int) -> None:
        self._require_off(axis)
        scaling = self._axes[axis].scaling
        scaling.change(scaling.counts_per_unit, polarity)

    def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
        self._require_off(axis)
        drive = self._axes[axis]
        drive.scaling.change(numerator / denominator, drive.scaling.polarity)
        drive.objects.forget()
        if drive.drive.online:  # else it is written when the drive is configured again
            write_quick_stop_ramp(drive)

    def home(self, axis: int, timeout_s: float) -> None:
        self._commands[axis].home(timeout_s)
        self._master.settle()

    def move(self, axis: int, target: float, profile: Profile) -> None:
        self._commands[axis].move(target, profile)

    def jog(self, axis: int, profile: Profile) -> None:
        self._commands[axis].jog(profile)

    def stop(self, axes: Sequence[int]) -> None:
        for axis in axes:
            self._commands[axis].stop()

    def quick_stop(self, axes: Sequence[int]) -> None:
        for axis in axes:
            self._commands[axis].quick_stop()

    def _require_off(self, axis: int) -> None:
        drive = self._axes[axis]
        if drive.report.powered:
            text = f"{drive.drive.name}: its scale cannot be changed while the servo is on"
            raise NotReady(text, axis=axis)
