"""Mutants: Stops, alarms and servos that fail once, late, at the last axis or in one direction."""

from __future__ import annotations

import time
from collections.abc import Sequence

from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import Operation, Profile
from robotd_sim import SimAxes, SimDevice


class QuickStopOfTheFirstOnly(Mutant):
    breaks = ("AxisDriver.quick_stop/starts", "last axis")
    found_by = "test_stops_of_some_axes.py::test_a_stop_reaches_each_named_axis_of_a_move"

    class Axes(SimAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            super().quick_stop(axes[:1])


class QuickStopsEverything(Mutant):
    breaks = ("AxisDriver.quick_stop/starts", "wrong axis")
    found_by = "test_stops_of_some_axes.py::test_a_stop_reaches_each_named_axis_of_a_move"

    class Axes(SimAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            super().quick_stop(range(self._simulation.axes))


class QuickStopIgnoredBackwards(Mutant):
    breaks = ("AxisDriver.quick_stop/starts", "one direction")
    found_by = "test_stops_of_some_axes.py::test_a_stop_reaches_each_named_axis_of_a_move"

    class Axes(SimAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            speeds = self._simulation.servo.command_velocity
            super().quick_stop([axis for axis in axes if speeds[axis] >= 0.0])


class QuickStopWorksOnce(Mutant):
    breaks = ("AxisDriver.quick_stop/starts", "second call")
    found_by = "test_stops_of_some_axes.py::test_a_stop_reaches_each_named_axis_of_a_move"

    class Axes(SimAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            done = self.__dict__.setdefault("done", set())
            super().quick_stop([axis for axis in axes if axis not in done])
            moving = [other for other in axes if self._states.operation[other] != Operation.IDLE]
            done.update(moving)


class StopTakesEightMilliseconds(Mutant):
    breaks = ("AxisDriver.stop/returns", "blocks")
    found_by = "test_ramps.py::test_a_stop_returns_at_once"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            super().stop(axes)
            time.sleep(0.008)


class QuickStopTakesEightMilliseconds(Mutant):
    breaks = ("AxisDriver.quick_stop/returns", "blocks")
    found_by = "test_ramps.py::test_a_stop_returns_at_once"

    class Axes(SimAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            time.sleep(0.008)
            super().quick_stop(axes)


class StopWorksOnce(Mutant):
    breaks = ("AxisDriver.stop/starts", "second call")
    found_by = "test_reopening.py::test_everything_works_again"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            done = self.__dict__.setdefault("done", set())
            moving = [other for other in axes if self._states.operation[other] != Operation.IDLE]
            super().stop([axis for axis in axes if axis not in done])
            done.update(moving)


class StopLostAfterReopen(Mutant):
    breaks = ("AxisDriver.stop/starts", "after re-open")
    found_by = "test_reopening.py::test_everything_works_again"

    class Device(SimDevice):
        def close(self) -> None:
            self.simulation.__dict__["closed"] = True
            super().close()

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            if not self._simulation.__dict__.get("closed"):
                super().stop(axes)


class SecondStopBeginsAnew(Mutant):
    breaks = ("AxisDriver.stop/idle", "side effect")
    found_by = "test_stops_of_some_axes.py::test_a_repeated_stop_changes_nothing"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            stopping = [a for a in axes if self._states.operation[a] == Operation.STOPPING]
            super().stop(axes)
            with self._world.lock:
                for axis in stopping:
                    self._motion.brake(axis, 0.3)


class StopLeavesTheLastStream(Mutant):
    breaks = ("AxisDriver.stop/stream", "last axis")
    found_by = "test_stops_of_some_axes.py::test_a_stop_reaches_each_named_axis_of_a_stream"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            last = self._simulation.axes - 1
            streams = self._states.operation[last] == Operation.STREAM
            super().stop([axis for axis in axes if axis != last or not streams])


class StopOfAStreamIsGentle(Mutant):
    breaks = ("AxisDriver.stop/stream", "clipped")
    found_by = "test_stops_of_some_axes.py::test_a_stop_reaches_each_named_axis_of_a_stream"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            streams = [a for a in axes if self._states.operation[a] == Operation.STREAM]
            super().stop(axes)
            with self._world.lock:
                for axis in streams:
                    self._motion.brake(axis, 0.3)


class StopOfVelocityStreamsIgnored(Mutant):
    breaks = ("AxisDriver.stop/stream", "ignored")
    found_by = (
        "test_stops_of_some_axes.py::test_a_stop_reaches_each_named_axis_of_a_velocity_stream"
    )

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            by_velocity = self._motion.stream.by_velocity & self._motion.stream.following
            super().stop([axis for axis in axes if not by_velocity[axis]])


class ClearingStopsAMove(Mutant):
    breaks = ("AxisDriver.clear_alarm/idle", "side effect")
    found_by = "test_last_axis.py::test_clearing_without_an_alarm_disturbs_no_motion"

    class Axes(SimAxes):
        def clear_alarm(self, axis: int, timeout_s: float) -> None:
            super().stop([axis])
            super().clear_alarm(axis, timeout_s)


class ClearsAnAlarmOnce(Mutant):
    breaks = ("AxisDriver.clear_alarm/clears", "second call")
    found_by = "test_reopening.py::test_everything_works_again"

    class Axes(SimAxes):
        def clear_alarm(self, axis: int, timeout_s: float) -> None:
            cleared = self.__dict__.setdefault("cleared", set())
            if axis not in cleared:
                had = self._states.amp_alarm[axis]
                super().clear_alarm(axis, timeout_s)
                if had:
                    cleared.add(axis)


class ClearsLater(Mutant):
    breaks = ("AxisDriver.clear_alarm/waits", "late")
    found_by = "test_last_axis.py::test_an_alarm_of_the_last_axis"

    class Axes(SimAxes):
        def clear_alarm(self, axis: int, timeout_s: float) -> None:
            with self._world.lock:
                self._world.advance()
                tick = self._world.tick + 100
                self._world.at(tick, lambda: self._simulation.power.clear(axis))


class ClearsAllButTheLast(Mutant):
    breaks = ("AxisDriver.clear_alarm/clears", "last axis")
    found_by = "test_last_axis.py::test_an_alarm_of_the_last_axis"

    class Axes(SimAxes):
        def clear_alarm(self, axis: int, timeout_s: float) -> None:
            if axis < self._simulation.axes - 1:
                super().clear_alarm(axis, timeout_s)


class ServoStaysOnWhileItStops(Mutant):
    breaks = ("AxisDriver.servo/disables", "ignored")
    found_by = "test_last_axis.py::test_a_servo_goes_off_in_every_state"

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            if on or self._states.operation[axis] != Operation.STOPPING:
                super().servo(axis, on, timeout_s)


class LastServoStaysOnInMotion(Mutant):
    breaks = ("AxisDriver.servo/disables", "last axis")
    found_by = "test_last_axis.py::test_a_servo_goes_off_in_every_state"

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            moves = self._world.moves(axis) and axis == self._simulation.axes - 1
            if on or not moves:
                super().servo(axis, on, timeout_s)


class LastAxisJumpsWhenEnabled(Mutant):
    breaks = ("AxisDriver.servo/no-jump", "last axis")
    found_by = "test_enable.py::test_enabling_does_not_move_the_axis"

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            was_on = self._states.servo_on[axis]
            super().servo(axis, on, timeout_s)
            if on and not was_on and axis == self._simulation.axes - 1:
                with self._world.lock:
                    here = float(self._simulation.servo.position[axis])
                    self._motion.move(axis, here + 0.006, Profile(0.1, 1.0, 1.0))


class SecondEnablingJumps(Mutant):
    breaks = ("AxisDriver.servo/no-jump", "second call")
    found_by = "test_enable.py::test_enabling_does_not_move_the_axis"

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            was_on = self._states.servo_on[axis]
            super().servo(axis, on, timeout_s)
            if on and not was_on:
                count = self.__dict__[f"count{axis}"] = self.__dict__.get(f"count{axis}", 0) + 1
                if count == 2:
                    with self._world.lock:
                        here = float(self._simulation.servo.position[axis])
                        self._motion.move(axis, here + 0.006, Profile(0.1, 1.0, 1.0))


class ServoOffReturnsEarly(Mutant):
    breaks = ("AxisDriver.servo/waits", "late")
    found_by = "test_enable.py::test_servo_returns_when_the_drive_says_so"

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            if on:
                super().servo(axis, on, timeout_s)
                return
            with self._world.lock:
                self._world.advance()
                self._world.at(self._world.tick + 60, lambda: self._simulation.power.turn_off(axis))
