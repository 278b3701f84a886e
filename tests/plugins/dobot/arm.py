"""The arm of the stand-in: six joints that move evenly to each target."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

JOINTS = 6
VELOCITY_DEG_S, REST_DEG_S = 180.0, 1e-3
RANGES_DEG = np.array([360.0, 360.0, 155.0, 360.0, 360.0, 360.0])
EMERGENCY_STOP, POSITIVE_LIMIT, NEGATIVE_LIMIT = 116, 64, 65  # of joint 1; others by steps of 2
FAILED, IN_ALARM, PRESSED, NO_POWER = -1, -2, -3, -4

Clock = Callable[[], float]


class Arm:
    """State of the arm at any time, degrees and seconds; one thread.

    Attributes:
        powered: the arm has power.
        enabled: the servos are on, all of them.
        dragged: it is in drag mode: a hand moves it, no target does.
        alarm: number of the alarm; 0: none.
        drive_alarm: joint, from 1, and number of an alarm of its drive.
        pressed: the emergency stop is pressed.
        payload: mass, and its centre in mm.
        offset: (6,) error of the encoders.
        blocked: (6,) joints that do not move.
        inputs, outputs: digital levels, bit 0 is terminal 1.
        tool_inputs, tool_outputs: those of the tool.
        frames: index of the selected tool and user frame, by command.
        stuck: levels of outputs that do not obey, by bit.
    """

    def __init__(self, clock: Clock = time.monotonic) -> None:
        self._clock = clock
        self.powered = True
        self.enabled = self.pressed = self.dragged = False
        self.alarm = self.inputs = self.outputs = 0
        self.drive_alarm = (0, 0)
        self.payload = (0.0, 0.0, 0.0, 0.0)
        self.tool_inputs = self.tool_outputs = 0
        self.frames = {"tool": 0, "user": 0}
        self.stuck: dict[int, bool] = {}
        self.offset = np.zeros(JOINTS)
        self.blocked = np.zeros(JOINTS, bool)
        self._start = self._target = np.zeros(JOINTS)
        self._began_s, self._time_s = clock(), 1.0
        self._measured, self._measured_s = np.zeros(JOINTS), clock()

    @property
    def in_alarm(self) -> bool:
        return bool(self.alarm or self.drive_alarm[0])

    @property
    def moves(self) -> bool:
        return bool((np.abs(self.state()[1]) > REST_DEG_S).any())

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
        if self.in_alarm or not self.enabled or self.dragged:
            return IN_ALARM if self.in_alarm else FAILED
        beyond = np.flatnonzero(np.abs(target) > RANGES_DEG)
        if beyond.size:
            joint = int(beyond[0])
            self.trip(2 * joint + (POSITIVE_LIMIT if target[joint] > 0 else NEGATIVE_LIMIT))
            return IN_ALARM
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
        if on and not self.powered:
            return NO_POWER
        if on and self.in_alarm:
            return PRESSED if self.pressed else IN_ALARM
        self.hold()
        self.enabled, self.dragged = on, False
        return 0

    def drag(self, on: bool) -> int:
        """Begin or end drag mode; return the error code."""
        if on and (self.in_alarm or not self.enabled or self.moves):
            return IN_ALARM if self.in_alarm else FAILED
        self.hold()
        self.dragged = on
        return 0

    def power(self, on: bool) -> int:
        """Switch the power of the arm; return the error code."""
        if not on:
            self.switch(False)
        self.powered = on
        return 0

    def trip(self, code: int, joint: int = 0) -> None:
        """Raise an alarm, of the drive of ``joint`` from 1: the arm stops, its servos go off."""
        if joint:
            self.drive_alarm = joint, code
        else:
            self.alarm = self.alarm or code
        self.hold()
        self.enabled = self.dragged = False

    @property
    def rejection(self) -> int:
        """Error code of commands that an arm with a fault or without power rejects; 0: none."""
        if self.pressed or self.in_alarm:
            return PRESSED if self.pressed else IN_ALARM
        return 0 if self.powered else NO_POWER

    def press(self, pressed: bool) -> int:
        """Press or release the emergency stop; return the error code."""
        self.pressed = pressed
        if pressed:
            self.trip(EMERGENCY_STOP)
        return 0

    def clear(self) -> int:
        """Clear the alarm; return the error code."""
        if self.pressed:
            return PRESSED
        self.alarm, self.drive_alarm = 0, (0, 0)
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

    def tool_output(self, bit: int, level: bool) -> None:
        """Switch an output of the tool."""
        self.tool_outputs = self.tool_outputs & ~(1 << bit) | level << bit

    def tool_input(self, bit: int, level: bool) -> None:
        """Let a sensor of the tool change an input."""
        self.tool_inputs = self.tool_inputs & ~(1 << bit) | level << bit

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
