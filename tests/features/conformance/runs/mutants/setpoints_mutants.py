"""Mutants: Single setpoints of streams, their watchdog, and the period of measured values."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np
from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import FloatArray, LateSetpoint, ProcessImage
from robotd_sim import SimAxes, SimDevice

STAY_AWAY = "test_whole_streams.py::test_axes_stop_each_time_that_setpoints_stay_away"
BOTH_MODES = "test_whole_streams.py::test_axes_of_both_modes_stream_together"
LAST_SETPOINT = "test_setpoints.py::test_a_stream_ends_on_its_last_setpoint"


class NextTickIsDue(Mutant):
    """Each setpoint is reached half a period after it was sent."""

    breaks = ("AxisDriver.stream/setpoint", "wrong value")
    found_by = "test_setpoints.py::test_setpoints_are_reached_however_far_ahead_they_are_sent"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            period_ns = round(1e9 / self._simulation.robot.cycle.rate_hz)
            super().stream(position, velocity, self._world.now_ns + period_ns // 2)


class PassesAtTheVelocityBefore(Mutant):
    """The velocity is that of the first setpoints at full speed."""

    breaks = ("AxisDriver.stream/position", "wrong value")
    found_by = "test_setpoints.py::test_a_setpoint_is_passed_at_its_velocity"

    class Axes(SimAxes):
        def begin_stream(self, axes: Sequence[int]) -> None:
            self.__dict__["fastest"] = np.zeros(self._simulation.axes)
            super().begin_stream(axes)

        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            fastest = self.__dict__["fastest"]
            np.copyto(fastest, velocity, where=np.abs(velocity) > np.abs(fastest))
            cruises = np.abs(velocity) > 0.3 * np.abs(fastest)
            super().stream(position, np.where(cruises, fastest, velocity), due_ns)


class LateSetpointIsKept(Mutant):
    """It is made instead of the next one."""

    breaks = ("AxisDriver.stream/late", "side effect")
    found_by = "test_setpoints.py::test_a_setpoint_that_was_too_late_has_no_effect"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            place, speed = self.__dict__.pop("kept", (position, velocity))
            try:
                super().stream(place, speed, due_ns)
            except LateSetpoint:
                self.__dict__["kept"] = position.copy(), velocity.copy()
                raise


class EndHoldsWhereItIs(Mutant):
    breaks = ("AxisDriver.end_stream/reached", "clipped")
    found_by = LAST_SETPOINT
    says = "away from its last setpoint"

    class Axes(SimAxes):
        def end_stream(self, axes: Sequence[int]) -> None:
            with self._world.lock:
                self._world.advance()
                stream, servo = self._motion.stream, self._simulation.servo
                for axis in axes:
                    if stream.following[axis] and not stream.velocity[axis]:
                        self._motion.hold(axis, float(servo.command[axis]))
            super().end_stream(axes)


class LastAxisHoldsTheSetpointBefore(Mutant):
    breaks = ("AxisDriver.end_stream/reached", "last axis")
    found_by = LAST_SETPOINT
    says = "axis 2 holds"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            self.__dict__["before"] = self._motion.stream.position[-1]
            super().stream(position, velocity, due_ns)

        def end_stream(self, axes: Sequence[int]) -> None:
            stands = not self._motion.stream.velocity[-1] and "before" in self.__dict__
            if stands and not self._motion.stream.by_velocity[-1]:
                self._motion.stream.position[-1] = self.__dict__["before"]
            super().end_stream(axes)


class VelocityChangesWhenDue(Mutant):
    """All at once."""

    breaks = ("AxisDriver.stream/velocity", "wrong value")
    found_by = "test_setpoints.py::test_between_two_setpoints_a_streamed_velocity_is_between_theirs"
    says = "0% of the change"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            super().stream(position, velocity, due_ns)
            with self._world.lock:
                stream, servo, tick = self._motion.stream, self._simulation.servo, self._world.tick
                before = self.__dict__.setdefault("before", [0.0] * self._simulation.axes)
                for axis in np.flatnonzero(stream.following & stream.by_velocity).tolist():
                    start = float(servo.command[axis])
                    ahead_s = (stream.end - tick) * servo.tick_s
                    stream.position[axis] = start + before[axis] * ahead_s
                    servo.follow(axis, tick, start, before[axis], 0.0)
                    before[axis] = stream.velocity[axis]


class VelocityChangesAtOnce(Mutant):
    """The travel is ahead of that of an even change."""

    breaks = ("AxisDriver.stream/velocity", "one direction")
    found_by = "test_setpoints.py::test_a_streamed_velocity_changes_evenly"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            super().stream(position, velocity, due_ns)
            with self._world.lock:
                stream, servo, tick = self._motion.stream, self._simulation.servo, self._world.tick
                for axis in np.flatnonzero(stream.following & stream.by_velocity).tolist():
                    if stream.velocity[axis] >= 0.0:
                        start, speed = float(servo.command[axis]), stream.velocity[axis]
                        ahead_s = (stream.end - tick) * servo.tick_s
                        stream.position[axis] = start + speed * ahead_s
                        servo.follow(axis, tick, start, speed, 0.0)


class AllStreamInTheModeOfTheLast(Mutant):
    breaks = ("AxisDriver.begin_stream/modes", "wrong axis")
    found_by = BOTH_MODES

    class Axes(SimAxes):
        def begin_stream(self, axes: Sequence[int]) -> None:
            super().begin_stream(axes)
            stream = self._motion.stream
            for axis in axes:
                stream.by_velocity[axis] = stream.by_velocity[axes[-1]]
            stream._take_stock()


class PositionsComeFirst(Mutant):
    """Axes in velocity mode do not move while one in position mode streams."""

    breaks = ("AxisDriver.begin_stream/modes", "ignored")
    found_by = BOTH_MODES
    says = "a stream of velocities beside others"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            stream = self._motion.stream
            mixed = (stream.following & ~stream.by_velocity).any()
            stands = stream.by_velocity if mixed else np.zeros_like(stream.by_velocity)
            super().stream(position, np.where(stands, 0.0, velocity), due_ns)


class VelocityStreamsAreNotWatched(Mutant):
    breaks = ("backend/watchdog", "ignored")
    found_by = STAY_AWAY
    says = "velocity mode"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            stream = self._motion.stream
            if (stream.following & stream.by_velocity).any():
                stream._called = self._world.tick
            super().read(image)


class WatchdogEndsWithTheConnection(Mutant):
    breaks = ("backend/watchdog", "after re-open")
    found_by = STAY_AWAY

    class Device(SimDevice):
        def stop_communication(self, timeout_s: float) -> None:
            super().stop_communication(timeout_s)
            self.simulation.motion.stream._on_timeout = lambda: None


class ForwardsIsNotWatchedTwice(Mutant):
    """After the first time an axis that streams in positive direction goes on."""

    breaks = ("backend/watchdog", "second call")
    found_by = STAY_AWAY

    class Device(SimDevice):
        def start_communication(self, timeout_s: float) -> None:
            super().start_communication(timeout_s)
            motion, stream = self.simulation.motion, self.simulation.motion.stream
            expired = list[int]()

            def brake() -> None:
                expired.append(1)
                if len(expired) == 1 or stream.velocity[0] < 0.0:
                    motion._stream_timed_out()

            stream._on_timeout = brake


class EveryThirdValue(Mutant):
    """Of those of each period; the others are held, with their time."""

    breaks = ("AxisDriver.feedback_period_s/period", "wrong value")
    found_by = "test_feedback.py::test_values_arrive_as_often_as_declared"
    says = "new time stamps within"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            count = self.__dict__["count"] = self.__dict__.get("count", 0) + 1
            moving = self._simulation.servo.command_velocity.any()
            if not moving or count % 3 == 0 or not image.fresh_ns:
                super().read(image)


class SetpointsAreReadLater(Mutant):
    """A tick after the call, from the arrays of the caller."""

    breaks = ("AxisDriver.stream/arrays", "wrong value")
    found_by = "test_whole_streams.py::test_setpoints_may_be_overwritten_after_the_call"
    says = "of its travel"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            super().stream(position, velocity, due_ns)

            def again() -> None:
                with suppress(LateSetpoint):
                    self._motion.stream.setpoint(position, velocity, due_ns)

            with self._world.lock:
                self._world.at(self._world.tick + 1, again)


class RepeatedSetpointsAreDropped(Mutant):
    """As the watchdog sees it, none comes while an axis rests."""

    breaks = ("AxisDriver.begin_stream/operation", "ignored")
    found_by = "test_whole_streams.py::test_a_stream_that_rests_goes_on"
    says = "shown after"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            before, self.__dict__["before"] = self.__dict__.get("before"), position.copy()
            if before is None or not np.array_equal(before, position, equal_nan=True):
                super().stream(position, velocity, due_ns)


class HoldsBackwards(Mutant):
    """Without setpoints an axis that moves in negative direction returns to its last one."""

    breaks = ("AxisDriver.underrun/underrun", "one direction")
    found_by = "test_underrun.py::test_an_axis_without_setpoints_does_what_underrun_says"
    says = "without setpoints"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            stream, servo = self._motion.stream, self._simulation.servo
            with self._world.lock:
                self._world.advance()
                if stream.following.any() and self._world.tick > stream.end + 1:
                    for axis, _ in stream._followers:
                        if stream.velocity[axis] < 0.0:
                            stream.velocity[axis] = 0.0
                            place = stream.position[axis]
                            servo.follow(axis, self._world.tick, place, 0.0, 0.0)
            super().read(image)


class FirstSetpointLost(Mutant):
    """The first setpoint of a stream only starts it."""

    breaks = ("AxisDriver.stream/setpoint", "ignored")
    found_by = "test_setpoints.py::test_streams_of_one_setpoint_add_up"
    says = "0.0 of 15 steps are made"

    class Axes(SimAxes):
        begun = False

        def begin_stream(self, axes: Sequence[int]) -> None:
            super().begin_stream(axes)
            self.begun = True

        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            begun, self.begun = self.begun, False
            if not begun:
                super().stream(position, velocity, due_ns)
