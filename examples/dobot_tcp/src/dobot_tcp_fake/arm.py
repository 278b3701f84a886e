"""The arm of the stand-in: six joints that move evenly to each target."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

JOINTS = 6
VELOCITY_DEG_S = 180.0
RANGES_DEG = np.array([360.0, 360.0, 155.0, 360.0, 360.0, 360.0])
EMERGENCY_STOP, OUT_OF_RANGE = 900, 901

Clock = Callable[[], float]


class Arm:
    """State of the arm at any time, degrees and seconds; one thread.

    Attributes:
        enabled: the servos are on, all of them.
        alarm: number of the alarm; 0: none.
        pressed: the emergency stop is pressed.
        offset: (6,) error of the encoders.
        blocked: (6,) joints that do not move.
        inputs, outputs: digital levels, bit 0 is terminal 1.
        stuck: levels of outputs that do not obey, by bit.
    """

    def __init__(self, clock: Clock = time.monotonic) -> None:
        self._clock = clock
        self.enabled = self.pressed = False
        self.alarm = self.inputs = self.outputs = 0
        self.stuck: dict[int, bool] = {}
        self.offset = np.zeros(JOINTS)
        self.blocked = np.zeros(JOINTS, bool)
        self._start = self._target = np.zeros(JOINTS)
        self._began_s, self._time_s = clock(), 1.0
        self._measured, self._measured_s = np.zeros(JOINTS), clock()

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """Return true position and velocity, (6,) each."""
        passed = (self._clock() - self._began_s) / self._time_s
        moved = np.where(self.blocked, 0.0, self._target - self._start)
        if passed >= 1.0:
            return self._start + moved, np.zeros(JOINTS)
        return self._start + passed * moved, moved / self._time_s

    def measure(self) -> tuple[np.ndarray, np.ndarray]:
        """Return position and velocity as encoders have them: velocity since the last call."""
        now_s, position = self._clock(), self.state()[0] + self.offset
        velocity = (position - self._measured) / max(now_s - self._measured_s, 1e-3)
        self._measured, self._measured_s = position, now_s
        return position, velocity

    def servo(self, target: np.ndarray, time_s: float) -> int:
        """Move to ``target`` within ``time_s``, no faster than the limit; return the error code."""
        if self.alarm or not self.enabled:
            return -2 if self.alarm else -1
        if (np.abs(target) > RANGES_DEG).any():
            self.trip(OUT_OF_RANGE)
            return -2
        position, _ = self.state()
        fastest = np.abs(target - position).max() / VELOCITY_DEG_S
        self._move(position, target, max(time_s, fastest))
        return 0

    def hold(self) -> None:
        """Stop where the arm is."""
        position, _ = self.state()
        self._move(position, position, 1.0)

    def switch(self, on: bool) -> int:
        """Switch all servos; return the error code."""
        if on and self.alarm:
            return -3 if self.pressed else -2
        self.hold()
        self.enabled = on
        return 0

    def trip(self, code: int) -> None:
        """Raise an alarm: the arm stops and its servos go off."""
        self.alarm = self.alarm or code
        self.hold()
        self.enabled = False

    def press(self, pressed: bool) -> None:
        """Press or release the emergency stop."""
        self.pressed = pressed
        if pressed:
            self.trip(EMERGENCY_STOP)

    def clear(self) -> int:
        """Clear the alarm; return the error code."""
        if self.pressed:
            return -3
        self.alarm = 0
        return 0

    def turn(self, joint: int, angle: float) -> None:
        """Turn a joint by hand."""
        position, _ = self.state()
        position[joint] += angle
        self._move(position, position, 1.0)

    def jump(self, joint: int, angle: float) -> None:
        """Let the encoder of a joint slip; no velocity is measured."""
        self.offset[joint] += angle
        self._measured[joint] += angle

    def block(self, joint: int, blocked: bool) -> None:
        """Hold a joint where it is, or let it go."""
        position, _ = self.state()
        self._move(position, self._target, 0.1)
        self.blocked[joint] = blocked

    def output(self, bit: int, level: bool) -> None:
        """Switch an output."""
        level = self.stuck.get(bit, level)
        self.outputs = self.outputs & ~(1 << bit) | level << bit

    def input(self, bit: int, level: bool) -> None:
        """Let a sensor change an input."""
        self.inputs = self.inputs & ~(1 << bit) | level << bit

    def stick(self, bit: int, level: bool | None) -> None:
        """Let an output keep ``level``; None: it obeys again."""
        self.stuck.pop(bit, None)
        if level is not None:
            self.output(bit, level)
            self.stuck[bit] = level

    def _move(self, start: np.ndarray, target: np.ndarray, time_s: float) -> None:
        self._start, self._target = start.copy(), target.copy()
        self._began_s, self._time_s = self._clock(), time_s
