"""Setpoints of a smooth path for streams, and the commands that a device shows for them."""

from __future__ import annotations

import numpy as np

from robotd.api import FloatArray, ProcessImage
from robotd_conformance.checks.harness import Harness
from robotd_conformance.checks.mixed_motion import SLOWEST_AXIS
from robotd_conformance.checks.recorded_motion import ramped

SHARE, RAMP_S = 0.25, 0.1  # of a profile's speed, and the time to reach it
CRUISE_S = 0.25  # from the start until it slows down


class Path:
    """Setpoints of one stream, and the commands that the device shows for them.

    Each axis speeds up to its ``speeds``, and cruises; ``brakes_s`` is when it slows down. The
    command of a device that is in time is ``setpoint`` of the values' time.

    Attributes:
        commands: (time, position commands, velocity commands) of each period.
    """

    def __init__(self, harness: Harness, speeds: FloatArray, brakes_s: float = np.inf) -> None:
        self.harness, self.speeds, self.brakes_s = harness, speeds, brakes_s
        self.start = harness.image.position_command.copy()
        self.began_ns = harness.clock.now_ns()
        self.commands: list[tuple[float, FloatArray, FloatArray]] = []

    def begin_again(self, speeds: FloatArray) -> None:
        """Begin a path with ``speeds`` at the end of this one, where the axes rest."""
        start, began_ns = self.setpoint(np.inf)[0], self.harness.clock.now_ns()
        self.start, self.speeds, self.began_ns = start, speeds, began_ns

    def time_s(self, now_ns: int) -> float:
        return (now_ns - self.began_ns) * 1e-9

    def setpoint(self, time_s: float) -> tuple[FloatArray, FloatArray]:
        distance_s, share = ramped(max(0.0, time_s), RAMP_S, self.brakes_s)
        return self.start + distance_s * self.speeds, share * self.speeds

    def note(self, image: ProcessImage) -> None:
        slow = self.harness.drivers.axes.feedback_period_s  # commands are newer than values
        time_s = self.time_s(image.stamp_ns if slow else image.fresh_ns)
        commands = image.position_command.copy(), image.velocity_command.copy()
        self.commands.append((time_s, *commands))

    def lags(self) -> FloatArray:
        """(n, n_axes) periods by which the command is behind its setpoints, at full speed."""
        behind = [
            (self.setpoint(time_s)[0] - position) / self.speeds
            for time_s, position, _ in self.commands
            if RAMP_S + 0.02 < time_s < self.brakes_s
        ]
        return np.array(behind) / self.harness.period_s

    def __call__(self, image: ProcessImage) -> None:
        self.note(image)
        setpoint = self.setpoint(self.time_s(self.harness.due_ns))
        if self.harness.stepped:  # nothing is late
            self.harness.drivers.axes.stream(*setpoint, self.harness.due_ns)
        else:
            self.harness.stream(*setpoint)


def different_speeds(harness: Harness) -> FloatArray:
    """Return (n_axes,) speeds, none as another one."""
    return np.asarray(harness.speeds(SHARE) * np.linspace(1.0, SLOWEST_AXIS, harness.count))
