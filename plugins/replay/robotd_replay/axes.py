"""Axes of a recording: values are read, motion is not supported."""

from __future__ import annotations

from collections.abc import Sequence

from robotd.api import AxisDriver, CommandMode, FloatArray, ProcessImage, Profile, Unsupported
from robotd_replay.device import ReplayDevice

MOTION = "motion of a recording"


class ReplayAxes(AxisDriver):
    """Read-only axes. Servo and alarm commands have no effect, motion raises Unsupported."""

    def __init__(self, device: ReplayDevice) -> None:
        self._device = device

    def read(self, image: ProcessImage) -> None:
        self._device.update_io()
        found = self._device.frame()
        if found is None:
            return
        frame, age_ns = found
        image.values[:] = frame["values"]
        image.numbers[:] = frame["numbers"]
        image.flags[:] = frame["flags"]
        recorded_age_ns = int(frame["start_ns"] - frame["fresh_ns"])
        image.fresh_ns = self._device.clock.now_ns() - age_ns - max(0, recorded_age_ns)

    def servo(self, axis: int, on: bool, timeout_s: float) -> None:
        """Do nothing: the servo is as it was."""

    def clear_alarm(self, axis: int, timeout_s: float) -> None:
        """Do nothing: the alarm is as it was."""

    def set_command_mode(self, axis: int, mode: CommandMode) -> None:
        """Do nothing: the mode is as it was."""

    def move(self, axis: int, target: float, profile: Profile) -> None:
        raise Unsupported(MOTION)

    def begin_stream(self, axes: Sequence[int]) -> None:
        raise Unsupported(MOTION)

    def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
        raise Unsupported(MOTION)

    def stop(self, axes: Sequence[int]) -> None:
        """Do nothing: what moves was recorded."""

    def quick_stop(self, axes: Sequence[int]) -> None:
        """Do nothing: what moves was recorded."""

    def end_stream(self, axes: Sequence[int]) -> None:
        """Do nothing: there is no stream."""
