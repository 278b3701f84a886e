"""Device of a recording: axes, inputs and outputs are read, nothing can be commanded."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from robotd.api import (
    NANOSECONDS,
    AxisDriver,
    BackendOptions,
    Clock,
    ConnectionState,
    DescriptorError,
    DeviceDriver,
    FloatArray,
    Frames,
    IoDriver,
    NotReady,
    ProcessImage,
    Profile,
    RobotdError,
    RobotDescriptor,
    Unsupported,
)
from robotd_recording.recording_reader import Recording, read_recording

IMAGE_BYTES = 8000  # of each image; a recording has the first of them
READ_ONLY = "this robot replays a recording: its axes are read-only and cannot be moved"
COMMANDS = "commands to recorded axes"


@dataclass(frozen=True, eq=False)
class Replayed:
    """Recording that is played.

    Attributes:
        recording: read whole.
        frames: periods in which the device took commands; at least one.
        repeat: begin again at the end.
    """

    recording: Recording
    frames: Frames
    repeat: bool


class ReplayOptions(BackendOptions):
    """Keys of ``backends.replay`` in a robot's file."""

    file: Path = Field(description="Recording to play.")
    repeat: bool = Field(
        True, description="Begin again at the end; false: the values become stale."
    )

    def check_robot(self, robot: RobotDescriptor) -> Any:
        """Read the recording. Raises DescriptorError: it does not fit the robot."""
        try:
            recording = read_recording(self.file)
        except RobotdError as error:
            raise DescriptorError(str(error), key="backends.replay.file") from error
        recorded = len(recording.info.axes)
        if recorded != robot.axes:
            text = f"{self.file} has {recorded} axes ({recording.info.robot}), not {robot.axes}"
            raise DescriptorError(text, key="backends.replay.file")
        ready = np.flatnonzero(recording.frames["ready"])
        if len(ready) == 0:
            text = f"{self.file}: the device was never ready in it"
            raise DescriptorError(text, key="backends.replay.file")
        return Replayed(recording, recording.frames[ready[0] : ready[-1] + 1], self.repeat)


class ReplayDevice(DeviceDriver):
    """Device whose recording begins when communication starts.

    Attributes:
        replayed: what is played.
        clock: of the control loop.
        inputs, outputs: images of the present time, updated in place.
        recorded_inputs, recorded_outputs: bytes that the recording has of them.
    """

    def __init__(self, replayed: Replayed, clock: Clock) -> None:
        self.replayed, self.clock = replayed, clock
        self.inputs, self.outputs = bytearray(IMAGE_BYTES), bytearray(IMAGE_BYTES)
        recording = replayed.recording
        self.recorded_inputs, self.recorded_outputs = (
            max((len(data) for _, data in changes), default=0)
            for changes in (recording.inputs, recording.outputs)
        )
        self._is_open = False
        self._began_ns = 0  # 0: it does not communicate
        self._starts_ns = replayed.frames["start_ns"] - replayed.frames["start_ns"][0]
        # The last period lasts as long as the others.
        period_ns = round(NANOSECONDS / replayed.recording.info.rate_hz)
        self._duration_ns = int(self._starts_ns[-1]) + period_ns

    def open(self, path: str = "", name: str = "") -> None:
        self._is_open = True

    def close(self) -> None:
        self._is_open = False
        self._began_ns = 0

    def start_communication(self, timeout_s: float) -> None:
        if not self._is_open:
            raise NotReady("the recording is not open")
        self._began_ns = self._began_ns or self.clock.now_ns()

    def stop_communication(self, timeout_s: float) -> None:
        self._began_ns = 0

    def state(self) -> ConnectionState:
        if self._began_ns:
            return ConnectionState.COMMUNICATING
        return ConnectionState.RUNNING if self._is_open else ConnectionState.IDLE

    def scan_network(self) -> str:
        info = self.replayed.recording.info
        return f"recording of {info.robot} on {info.backend}: {len(info.axes)} axes"

    def frame(self) -> tuple[Any, int] | None:
        """Return the present frame and its age in ns; None before and after the recording."""
        began_ns = self._began_ns
        if not began_ns:
            return None
        elapsed_ns = self.clock.now_ns() - began_ns
        if elapsed_ns >= self._duration_ns and not self.replayed.repeat:
            return None
        elapsed_ns %= self._duration_ns
        index = int(np.searchsorted(self._starts_ns, elapsed_ns, side="right")) - 1
        return self.replayed.frames[index], elapsed_ns - int(self._starts_ns[index])

    def update_io(self) -> None:
        """Set the images to the present time, or to the start when stopped. Control loop.

        After the recording they stay as they were at its end.
        """
        found = self.frame()
        if found is None and self._began_ns:
            return
        frame = self.replayed.frames[0] if found is None else found[0]
        time_ns, recording = int(frame["start_ns"]), self.replayed.recording
        for image, changes in ((self.inputs, recording.inputs), (self.outputs, recording.outputs)):
            if changes:  # the first one counts before it, too
                last = bisect_right(changes, time_ns, key=lambda change: change[0])
                data = changes[max(0, last - 1)][1]
                image[: len(data)] = data


class ReplayIo(IoDriver):
    """The I/O image as it was. Reads of what was not recorded raise NotReady."""

    def __init__(self, device: ReplayDevice) -> None:
        self._device = device

    @property
    def input_bytes(self) -> int:
        return IMAGE_BYTES

    @property
    def output_bytes(self) -> int:
        return IMAGE_BYTES

    @property
    def live(self) -> tuple[memoryview, memoryview]:
        return memoryview(self._device.inputs), memoryview(self._device.outputs)

    def read_inputs(self, byte: int, length: int) -> bytes:
        self._require("input", byte, length, self._device.recorded_inputs)
        return bytes(self._device.inputs[byte : byte + length])

    def read_outputs(self, byte: int, length: int) -> bytes:
        self._require("output", byte, length, self._device.recorded_outputs)
        return bytes(self._device.outputs[byte : byte + length])

    def write_outputs(self, byte: int, data: bytes) -> None:
        raise Unsupported("outputs of a recording")

    def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
        raise Unsupported("outputs of a recording")

    @staticmethod
    def _require(kind: str, byte: int, length: int, recorded: int) -> None:
        if byte + length > recorded:
            has = f"the first {recorded}" if recorded else "none"
            raise NotReady(
                f"{kind} byte {byte + length - 1} is not in the recording, which has {has}"
            )


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
