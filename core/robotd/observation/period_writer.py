"""Copy of each period of the control loop into the ring of frames."""

from __future__ import annotations

from collections.abc import Callable

from robotd.observation.frame_ring import COUNT_BYTES, FrameRing
from robotd.observation.io_sampler import INPUTS, OUTPUTS, IoSampler
from robotd.robot import Robot


def period_writer(robot: Robot, ring: FrameRing, io: IoSampler) -> Callable[[], None]:
    """Return the observer of the control loop: copies the period that has ended.

    One function without arguments for header, image and I/O: with cold caches, as between two
    periods, each call of another one takes 1 us. Measured in the control loop at load 6: 10 us,
    with functions of their own for frame and I/O 13 us.

    ``io``: is given the changes of a live image.
    """
    image, mixer, connection = robot.image, robot.mixer, robot.connection
    stats, memory, count = robot.control_loop.stats, ring.memory, ring.count
    frame, header, gripper = image.frame, image.header, robot.gripper
    capacity, size = ring.capacity, ring.type.itemsize
    has_live, add = io.live is not None, io.add
    read_inputs, read_outputs = io.live or (bytes, bytes)
    inputs = outputs = b""
    reasons: list[str] = []
    written = 0

    def write_period() -> None:
        nonlocal written, inputs, outputs, reasons
        start_ns, late_ns, header[4] = stats.last
        header[0], header[3] = start_ns, late_ns
        header[1], header[2] = image.stamp_ns, image.fresh_ns
        if image.reason != reasons:
            reasons = [*image.reason]
            ring.reasons.append((start_ns, reasons))  # before the frame can be read
        header[5], header[6], header[7] = stats.missed, mixer.sent_ns, connection.ready
        if gripper is not None:
            header[8] = round(gripper.closed * 1e6)
        at = COUNT_BYTES + written % capacity * size
        memory[at : at + size] = frame
        written += 1
        count[0] = written
        if has_live:
            if (now := read_inputs()) != inputs:
                inputs = now
                add((start_ns, INPUTS, now))
            if (now := read_outputs()) != outputs:
                outputs = now
                add((start_ns, OUTPUTS, now))

    return write_period
