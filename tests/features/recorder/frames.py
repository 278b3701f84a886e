"""Recordings for tests: a ring filled by hand, and its file."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from robotd.device.process_image import ProcessImage
from robotd.events import Event
from robotd.observation.frame_ring import COUNT_BYTES, HEADER, FrameMemory, FrameRing, Frames
from robotd_recording.recording_writer import RecordingInfo, create_recording

AXES = ("joint1", "joint2", "axis 2")
OFFSET_NS = 1_700_000_000_123_456_789
PERIOD_NS = 2_000_000

INFO = RecordingInfo(
    robot="arm",
    backend="sim",
    variant="",
    version="0.1.0",
    cause="test",
    rate_hz=500.0,
    axes=AXES,
    joints=(0, 1),
    limits={"joint1": (-3.0, 3.0, 2.0, 10.0), "joint2": (-1.0, 1.0, 2.0, 10.0)},
    offset_ns=OFFSET_NS,
)


def write_frame(ring: FrameMemory, image: ProcessImage, **header: int) -> None:
    """Append a copy of the image, with the numbers of its header; 0 where they are not given."""
    for place, name in enumerate(HEADER):
        image.header[place] = header.get(name, 0)
    size = ring.type.itemsize
    at = COUNT_BYTES + ring.written % ring.capacity * size
    ring.memory[at : at + size] = image.frame
    ring.count[0] += 1


def ramp(periods: int = 100) -> Frames:
    """Frames of a motion; an alarm of axis 1 in the second half, no setpoint in the first ten."""
    image = ProcessImage(len(AXES))
    ring = FrameRing(image.axes, 500.0, 10.0)
    image.servo_on[:] = True
    image.offline[:] = False
    for period in range(1, periods + 1):
        time_ns = period * PERIOD_NS
        image.values[:] = np.arange(15).reshape(5, 3) + period * 1e-3
        image.torque[2] = np.nan
        image.setpoint[:] = image.commands + 0.5
        image.amp_alarm[1] = period > periods // 2
        image.alarm_code[1] = 0x8611 if period > periods // 2 else 0
        due_ns = time_ns + PERIOD_NS if period > 10 else 0
        write_frame(
            ring,
            image,
            start_ns=time_ns + 70,
            stamp_ns=time_ns,
            fresh_ns=time_ns - 500,
            late_ns=70,
            execution_ns=31_000,
            missed=3,
            due_ns=due_ns,
            ready=True,
        )
    return ring.since(0)[0]


def write(path: Path, frames: Frames, urdf: str = "", events: Iterable[Event] = ()) -> None:
    """Write ``frames`` as the file ``path``."""
    writer = create_recording(path, INFO, urdf)
    for event in events:
        writer.event(event)
    writer.frames(frames)
    writer.close()
