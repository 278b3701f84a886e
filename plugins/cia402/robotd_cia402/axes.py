"""Axis driver of CiA 402 drives: passes each call to its axes."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence

from robotd.api import (
    AxisDriver,
    Clock,
    CommandMode,
    NotReady,
    Profile,
    Underrun,
    Unsupported,
)
from robotd_cia402.axis import Axis
from robotd_cia402.commands import Commands


class Cia402Axes(AxisDriver):
    """Axes of one fieldbus; a backend adds ``read``, ``stream`` and the two abstract methods."""

    def __init__(self, axes: Sequence[Axis], clock: Clock) -> None:
        self._axes = axes
        self._commands = [Commands(axis, clock) for axis in axes]

    @abstractmethod
    def on_stream_begun(self) -> None:
        """Start the time-out of the stream. Worker."""

    @abstractmethod
    def settle(self) -> None:
        """Wait until the process image shows the latest change. Worker.

        It returns after some periods where no control loop runs.
        """

    @property
    def underrun(self) -> Underrun:
        return Underrun.HOLD  # without frames from the control loop a drive holds its position

    def begin_stream(self, axes: Sequence[int]) -> None:
        for axis in axes:
            self._commands[axis].require_online()
        try:
            for axis in axes:
                self._commands[axis].prepare_stream()
        finally:
            self.on_stream_begun()
        for axis in axes:
            self._commands[axis].begin_stream()
        self.settle()

    def end_stream(self, axes: Sequence[int]) -> None:
        for axis in axes:
            self._commands[axis].end_stream()
        self.settle()

    def servo(self, axis: int, on: bool, timeout_s: float) -> None:
        commands = self._commands[axis]
        if on:
            commands.enable(timeout_s)
        else:
            commands.disable(timeout_s)
        self.settle()

    def clear_alarm(self, axis: int, timeout_s: float) -> None:
        self._commands[axis].clear_alarm(timeout_s)
        self.settle()

    def set_command_mode(self, axis: int, mode: CommandMode) -> None:
        if mode is CommandMode.TORQUE:
            raise Unsupported("torque mode")
        self._commands[axis].set_mode(mode)
        self.settle()

    def set_polarity(self, axis: int, polarity: int) -> None:
        self._require_off(axis)
        self._axes[axis].scaling.polarity = polarity

    def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
        self._require_off(axis)
        drive = self._axes[axis]
        drive.scaling.counts_per_unit = numerator / denominator
        drive.objects.forget()

    def home(self, axis: int, timeout_s: float) -> None:
        self._commands[axis].home(timeout_s)
        self.settle()

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
