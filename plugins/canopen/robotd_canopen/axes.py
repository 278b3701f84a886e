"""Axis driver: passes each call to the axes that it is for."""

from __future__ import annotations

from collections.abc import Sequence

from robotd.api import (
    AxisDriver,
    CommandMode,
    FloatArray,
    NotReady,
    ProcessImage,
    Profile,
    Underrun,
    Unsupported,
)
from robotd_canopen.commands import Commands
from robotd_canopen.master import Master


class CanopenAxes(AxisDriver):
    """All axes of one network."""

    def __init__(self, master: Master) -> None:
        self._master = master
        self._commands = [Commands(axis, master.clock) for axis in master.axes]

    @property
    def underrun(self) -> Underrun:
        return Underrun.HOLD  # without SYNC from the control loop a drive holds its position

    def read(self, image: ProcessImage) -> None:
        self._master.read(image)

    def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
        self._master.stream(position.tolist(), velocity.tolist(), due_ns)

    def begin_stream(self, axes: Sequence[int]) -> None:
        for axis in axes:
            self._commands[axis].require_online()
        try:
            for axis in axes:
                self._commands[axis].prepare_stream()
        finally:
            self._master.begin_stream()
        for axis in axes:
            self._commands[axis].begin_stream()
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
        if mode is CommandMode.TORQUE:
            raise Unsupported("torque mode")
        self._commands[axis].set_mode(mode)
        self._master.settle()

    def set_polarity(self, axis: int, polarity: int) -> None:
        self._off(axis)
        self._master.axes[axis].scaling.polarity = polarity

    def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
        self._off(axis)
        drive = self._master.axes[axis]
        drive.scaling.counts_per_unit = numerator / denominator
        drive.objects.forget()

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

    def _off(self, axis: int) -> None:
        drive = self._master.axes[axis]
        if drive.report.powered:
            text = f"node {drive.node.id}: its scale cannot be changed while the servo is on"
            raise NotReady(text, axis=axis)
