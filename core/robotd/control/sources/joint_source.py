"""Base of the sources that move joints: phases, faults of drives, end at rest."""

from __future__ import annotations

from enum import Enum, auto
from typing import ClassVar

import numpy as np

from robotd.arrays import BoolArray, FloatArray, IntArray
from robotd.clock import NANOSECONDS
from robotd.control.loop.setpoint_source import Outcome, SetpointSource
from robotd.control.loop.stall_recovery import after_stall
from robotd.device.image_waits import IMAGE_LATENCY_S
from robotd.device.process_image import ProcessImage
from robotd.device.state import STREAMING
from robotd.motion import JointLimits

REST_TIMEOUT_S = 2.0  # after that a joint that still moves is reported, not waited for
SETTLED_PERIODS = 2  # consecutive periods within tolerance that count as arrived, or at rest
STALL_S = 0.02  # a longer control-loop stall may be the reason why a device stopped by itself


class SourcePhase(Enum):
    """RUNNING → ARRIVING → end, or from either by STOPPING → RESTING → end."""

    RUNNING = auto()  # on the path, in time
    ARRIVING = auto()  # at the end of the path, until every joint is within its goal tolerance
    STOPPING = auto()  # slowing down along the path
    RESTING = auto()  # the command is at rest, until the joints are


class JointSource(SetpointSource):
    """Motion of joints: ends with a fault when a drive does not follow.

    Args:
        axes, start_ns, setpoint: see ``SetpointSource``.
        stopped_velocity: (m,) rad/s or m/s below which a joint is at rest.
        response_s: see ``AxisDriver``.

    Attributes:
        streams: the axes have to stay in streaming once they were in it.
    """

    streams: ClassVar[bool] = True

    def __init__(
        self,
        limits: JointLimits,
        axes: IntArray,
        start_ns: int,
        setpoint: FloatArray,
        stopped_velocity: FloatArray,
        response_s: float = 0.0,
    ) -> None:
        super().__init__(axes, start_ns, setpoint)
        self._response_s = response_s
        self._limits, self._axes, self._stopped_velocity = limits, axes, stopped_velocity
        self._phase, self._phase_since_ns, self._settled_periods = SourcePhase.RUNNING, start_ns, 0
        self._advanced_ns = start_ns
        self._was_streaming, self._first_ns = False, 0  # time of its first image
        self._joints = limits.per_joint()
        self._range: FloatArray = np.array([joint.measured for joint in self._joints]).T
        self._outside: BoolArray | None = None  # joints beyond it in the last image; None: no image
        self._healthy = b""  # flags and operations of an image without a fault

    def _continue(self, running: SetpointSource, advanced_ns: int, delay_ns: int) -> None:
        """Take over setpoint and time of ``running``; the arguments are those of ``take_over``."""
        self.setpoint[:] = running.setpoint
        self._advanced_ns = advanced_ns
        self.start_ns += delay_ns

    def _begin_period(self, time_ns: int) -> int:
        """Return the time since the period before, in ns."""
        pause_ns, self._advanced_ns = time_ns - self._advanced_ns, time_ns
        return pause_ns

    def _enter(self, phase: SourcePhase, time_ns: int) -> None:
        """Begin ``phase`` at ``time_ns``; the present one begins again."""
        self._phase, self._phase_since_ns, self._settled_periods = phase, time_ns, 0

    def _phase_age_s(self, time_ns: int) -> float:
        """Return the time since the phase began."""
        return (time_ns - self._phase_since_ns) / NANOSECONDS

    def _settle(self, within_tolerance: bool) -> bool:
        """Count a period of the phase; return True after ``SETTLED_PERIODS`` in tolerance."""
        self._settled_periods = self._settled_periods + 1 if within_tolerance else 0
        return self._settled_periods >= SETTLED_PERIODS

    def _moves(self, image: ProcessImage) -> bool:
        """Return True while a joint moves."""
        fast = np.abs(image.velocity[self.columns]) > self._stopped_velocity
        # The velocity of an offline drive is an old value.
        return bool((fast & ~image.offline[self.columns]).any())

    def _is_settled(self, time_ns: int, *, at_rest: bool) -> bool:
        """Count a period; return True when the joints are at rest, or were waited for."""
        age_s = self._phase_age_s(time_ns)
        return self._settle(at_rest and age_s >= self._response_s) or age_s > REST_TIMEOUT_S

    def _end_at_rest(self, time_ns: int, image: ProcessImage) -> None:
        """End as requested when the joints are at rest, or were waited for."""
        moving = self._moves(image)
        if self._is_settled(time_ns, at_rest=not moving):
            self._finish(moving=moving)

    def _finish(self, *, moving: bool) -> None:
        """End as requested; no effect without a request."""
        if self.completion.requested is not None:
            outcome, message = self.completion.requested
            self.completion.finish(outcome, f"{message}; joints still move" if moving else message)

    def _check_drives(self, image: ProcessImage, time_s: float, pause_ns: int) -> None:
        """End with a fault when a drive does not follow, also during a stop.

        A joint that leaves its position limits stops the motion.

        Args:
            time_s: for the text: since the start, or of the trajectory.
            pause_ns: since the period before.
        """
        self._check_positions(image, time_s)
        seen = image.flags.tobytes() + image.operation.tobytes()
        if seen == self._healthy:
            return
        if self._all_follow(image):
            self._healthy = seen if self._was_streaming or not self.streams else b""
        elif not self.completion.is_fault:
            self.completion.escalate(self._fault_text(image, time_s, pause_ns))

    def _check_positions(self, image: ProcessImage, time_s: float) -> None:
        """Request the end once a joint has left its limits; it may begin outside, and come back."""
        position = image.position[self.columns]
        outside = (position < self._range[0]) | (position > self._range[1])
        if self._outside is not None and np.count_nonzero(outside):
            for joint in np.flatnonzero(outside & ~self._outside).tolist():
                excess = self._joints[joint].excess(float(position[joint]))
                text = f"{self._limits.names[joint]} {_when(time_s)}: {excess}"
                self.completion.request(Outcome.STOPPED, text)
        self._outside = outside

    def _all_follow(self, image: ProcessImage) -> bool:
        """Return False when a drive has a fault or was stopped by another command."""
        axes, joints = self._axes, len(self._axes)
        return (
            self._obey(image)
            and np.count_nonzero(image.servo_on[axes]) == joints
            and not np.count_nonzero(image.amp_alarm[axes])
            and not np.count_nonzero(image.offline[axes])
        )

    def _obey(self, image: ProcessImage) -> bool:
        """Check that no other command moves the axes; the first images do not show it yet."""
        if not self.streams:
            return True
        streaming = bool((image.operation[self._axes] == STREAMING).all())
        self._first_ns = self._first_ns or image.stamp_ns
        is_shown = image.fresh_ns - self._first_ns > IMAGE_LATENCY_S * NANOSECONDS
        self._was_streaming |= streaming or is_shown
        return streaming or not self._was_streaming

    def _fault_text(self, image: ProcessImage, time_s: float, pause_ns: int) -> str:
        """Return joint, time and reason of the most severe fault."""
        reasons = [
            (image.offline | image.amp_alarm, ""),
            (~image.servo_on, "servo went off"),
            (image.operation != STREAMING, _stop_reason(pause_ns)),
        ]
        for failed, text in reasons:
            for name, axis in zip(self._limits.names, self._axes, strict=True):
                if failed[axis]:
                    if fault := image.controller_fault:
                        return f"{fault} {_when(time_s)}"
                    reason = f" ({image.reason[axis]})" if image.reason[axis] else ""
                    said = f"{text}{reason}" if text else image.fault(axis)
                    return f"{name} {_when(time_s)}: {said}"
        return "a drive does not follow"


def _when(time_s: float) -> str:
    """Return a time of the motion for people; a waiting goal has negative ones."""
    return f"{-time_s:.3f} s before the start" if time_s < 0.0 else f"at {time_s:.3f} s"


def _stop_reason(pause_ns: int) -> str:
    pause_s = pause_ns / NANOSECONDS
    if pause_s < STALL_S:
        return "stopped by the device or another command"
    return f"stopped by the device {after_stall(pause_s)}"
