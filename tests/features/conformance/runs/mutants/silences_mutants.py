"""Mutants: drives that are silent, and get what they must not when they answer again."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import FloatArray, Operation, ProcessImage
from robotd_sim import SimAxes

STEP = "test_silences.py::test_a_drive_that_answers_again_gets_no_step"
PAST = "test_silences.py::test_what_was_sent_in_a_silence_is_not_executed_after_it"
STOPS = "test_silences.py::test_a_stop_in_a_silence_stops"
OFF = "test_silences.py::test_a_servo_goes_off_in_a_silence"


class DeafAxes(SimAxes):
    """Axes that get no setpoint while no value arrives: the deaf ones keep their place.

    Attributes:
        deaf: axes, as a slice.
        since: number of the silence from which on they are.
    """

    deaf: ClassVar[slice] = slice(None)
    since: ClassVar[int] = 1

    def read(self, image: ProcessImage) -> None:
        frozen, before = self._simulation.network.frozen, self.__dict__.get("frozen", False)
        self.__dict__["frozen"] = frozen
        self.__dict__["silences"] = self.__dict__.get("silences", 0) + (frozen and not before)
        super().read(image)

    @property
    def is_silent(self) -> bool:
        frozen = self._simulation.network.frozen
        return bool(frozen) and self.__dict__.get("silences", 0) >= self.since

    def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
        position, velocity = position.copy(), velocity.copy()
        self._change(position, velocity)
        super().stream(position, velocity, due_ns)

    def _change(self, position: FloatArray, velocity: FloatArray) -> None:
        """Replace what the deaf axes do not get; afterwards they get the travel in one period."""
        if self.is_silent:
            held = self.__dict__.setdefault("held", np.array(self._simulation.servo.command))
            position[self.deaf], velocity[self.deaf] = held[self.deaf], 0.0
        else:
            self.__dict__.pop("held", None)


class TheWayOfTheSilenceInOnePeriod(Mutant):
    breaks = ("AxisDriver/silence", "wrong value")
    found_by = STEP
    says = "after a silence of"
    Axes = DeafAxes


class LastAxisGetsTheWayOfItsSilence(Mutant):
    breaks = ("AxisDriver/silence", "last axis")
    found_by = STEP
    says = "axis 5: .* after a silence of"
    robot = "cr3a"  # the last axis of the kit's own robot has no velocity limit

    class Axes(DeafAxes):
        deaf = slice(-1, None)


class SecondSilenceIsMadeUpForInOnePeriod(Mutant):
    breaks = ("AxisDriver/silence", "second call")
    found_by = STEP

    class Axes(DeafAxes):
        since = 2


class KeepingAxes(DeafAxes):
    """Axes whose setpoints of a silence wait, and are executed one by one after it."""

    def _change(self, position: FloatArray, velocity: FloatArray) -> None:
        waiting = self.__dict__.setdefault("waiting", deque())
        if self.is_silent or waiting:
            waiting.append((position.copy(), velocity.copy()))
        if self.is_silent:
            super()._change(position, velocity)
        elif waiting:
            late_position, late_velocity = waiting.popleft()
            position[self.deaf] = late_position[self.deaf]
            velocity[self.deaf] = late_velocity[self.deaf]


class WhatWaitedIsExecutedLater(Mutant):
    breaks = ("AxisDriver/past", "late")
    found_by = PAST
    says = "of the past after a silence of"
    Axes = KeepingAxes


class WhatWaitedForTheLastAxisIsExecutedLater(Mutant):
    breaks = ("AxisDriver/past", "last axis")
    found_by = PAST
    says = "axis 2 executes"

    class Axes(KeepingAxes):
        deaf = slice(-1, None)


class WhatWaitedInTheSecondSilenceIsExecutedLater(Mutant):
    breaks = ("AxisDriver/past", "second call")
    found_by = PAST

    class Axes(KeepingAxes):
        since = 2


class SecondStopInTheSilenceIsLost(Mutant):
    breaks = ("AxisDriver/takes-away", "second call")
    found_by = STOPS

    class Axes(DeafAxes):
        since = 2

        def stop(self, axes: Sequence[int]) -> None:
            if not self.is_silent:
                super().stop(axes)


class StopsOfTheSilenceAreLost(Mutant):
    breaks = ("AxisDriver/takes-away", "ignored")
    found_by = STOPS
    says = "stopped in a silence"

    class Axes(DeafAxes):
        def stop(self, axes: Sequence[int]) -> None:
            jogs = self._states.operation == Operation.VELOCITY
            if not (self.is_silent and jogs.any()):
                super().stop(axes)


class LastAxisIsNotStoppedInTheSilence(Mutant):
    breaks = ("AxisDriver/takes-away", "last axis")
    found_by = STOPS

    class Axes(DeafAxes):
        def stop(self, axes: Sequence[int]) -> None:
            super().stop(list(axes)[:-1] if self.is_silent else axes)


class ServoOffOfTheSilenceIsLost(Mutant):
    breaks = ("AxisDriver/takes-away", "ignored")
    found_by = OFF
    says = "switched off in a silence"

    class Axes(DeafAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            if on or not self.is_silent:
                super().servo(axis, on, timeout_s)
