"""Axes of a recording: values are read, nothing can be commanded."""

from __future__ import annotations

from collections.abc import Sequence

from robotd.api import AxisDriver, FloatArray, ProcessImage, Profile, Unsupported
from robotd_replay.device import ReplayDevice

READ_ONLY = "this robot replays a recording: its axes are read-only and cannot be moved"
COMMANDS = "commands to recorded axes"


class ReplayAxes(AxisDriver):
    """Read-only axes: the core gives them no commands."""

    def __init__(self, device: ReplayDevice) -> None:
        self._device = device

    @property
    def read_only(self) -> str:
        return READ_ONLY

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
        raise Unsupported(COMMANDS)

    def clear_alarm(self, axis: int, timeout_s: float) -> None:
        raise Unsupported(COMMANDS)

    def move(self, axis: int, target: float, profile: Profile) -> None:
        raise Unsupported(COMMANDS)

    def begin_stream(self, axes: Sequence[int]) -> None:
        raise Unsupported(COMMANDS)

    def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
        raise Unsupported(COMMANDS)

    def end_stream(self, axes: Sequence[int]) -> None:
        raise Unsupported(COMMANDS)

    def stop(self, axes: Sequence[int]) -> None:
        """Do nothing: what moves was recorded."""
