"""Options of the replay backend, and the part of a recording that is played."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from robotd.api import BackendOptions, DescriptorError, Frames, RobotdError, RobotDescriptor
from robotd_recording.recording_reader import Recording, read_recording


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
