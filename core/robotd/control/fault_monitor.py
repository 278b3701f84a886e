"""Fault monitor: detects drives that do not follow a trajectory."""

from __future__ import annotations

import numpy as np

from robotd.arrays import IntArray
from robotd.clock import NANOSECONDS
from robotd.control.stall_recovery import after_stall
from robotd.device.process_image import ProcessImage
from robotd.device.state import Operation

STALL_S = 0.02  # a longer control-loop stall may be the reason why a device stopped by itself


class FaultMonitor:
    """Checks the drives of an execution each period. Control-loop thread.

    Args:
        names: of the joints.
        axes: (m,) index of each joint's axis.
        streamed: the axes have to stay in streaming once they were in it.
    """

    def __init__(self, names: tuple[str, ...], axes: IntArray, *, streamed: bool) -> None:
        self._names, self._axes = names, axes
        self._streamed = streamed
        self._was_streaming = False
        self._healthy = b""  # flags and operations of an image without a fault

    def is_faulty(self, image: ProcessImage) -> bool:
        """Return True when a drive has a fault or was stopped by another command."""
        seen = image.flags.tobytes() + image.operation.tobytes()
        if seen == self._healthy:
            return False
        axes, joints = self._axes, len(self._axes)
        healthy = (
            self._obeys(image)
            and np.count_nonzero(image.servo_on[axes]) == joints
            and not np.count_nonzero(image.amp_alarm[axes])
            and not np.count_nonzero(image.offline[axes])
        )
        if healthy:
            self._healthy = seen
        return not healthy

    def describe(self, image: ProcessImage, time_s: float, pause_ns: int) -> str:
        """Return joint, time and reason of the most severe fault.

        Args:
            image: faulty one.
            time_s: trajectory time.
            pause_ns: since the period before.
        """
        reasons = [
            (image.offline | image.amp_alarm, ""),
            (~image.servo_on, "servo went off"),
            (image.operation != Operation.STREAM, _stop_reason(pause_ns)),
        ]
        for failed, text in reasons:
            for name, axis in zip(self._names, self._axes, strict=True):
                if failed[axis]:
                    if fault := image.controller_fault:
                        return f"{fault} at {time_s:.3f} s"
                    reason = f" ({image.reason[axis]})" if image.reason[axis] else ""
                    said = f"{text}{reason}" if text else image.fault(axis)
                    return f"{name} at {time_s:.3f} s: {said}"
        return "a drive does not follow"

    def _obeys(self, image: ProcessImage) -> bool:
        """Check that no other command moves the axes; older images do not show it yet."""
        if not self._streamed:
            return True
        streaming = bool((image.operation[self._axes] == Operation.STREAM).all())
        self._was_streaming |= streaming
        return streaming or not self._was_streaming


def _stop_reason(pause_ns: int) -> str:
    pause_s = pause_ns / NANOSECONDS
    if pause_s < STALL_S:
        return "stopped by the device or another command"
    return f"stopped by the device {after_stall(pause_s)}"
