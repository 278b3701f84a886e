"""Mutants: Axes, written from the contract alone before any check was run on them."""

from __future__ import annotations

import os
import threading
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from tests.features.conformance.runs.mutants.plugin import Mutant, ReadAnew

from robotd.api import CommandMode, FloatArray, Operation, ProcessImage, Profile
from robotd_sim import SimAxes


class LastAxisIsTenPercentFaster(Mutant):
    breaks = ("AxisDriver.move/profile", "last axis")
    found_by = "test_small_and_large.py::test_a_slow_move_is_as_slow_as_it_was_asked_for"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            share = 1.15 if axis == self._simulation.axes - 1 else 1.0
            super().move(axis, target, replace(profile, velocity=share * profile.velocity))


class FartherTargetsIgnored(Mutant):
    """A running move is overridden only where it has to turn round."""

    breaks = ("AxisDriver.move/overrides", "ignored")
    found_by = "test_small_and_large.py::test_small_moves_add_up"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            servo, running = self._simulation.servo, self._states.operation[axis]
            displacement = target - float(servo.command[axis])
            same = displacement * float(servo.command_velocity[axis]) > 0.0
            if not (running == Operation.POSITION and same):
                super().move(axis, target, profile)


class OverridesKeepTheVelocity(Mutant):
    breaks = ("AxisDriver.move/overrides", "wrong value")
    found_by = "test_profiles.py::test_a_new_target_has_its_own_profile"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            kept = self.__dict__.setdefault("kept", {})
            if self._states.operation[axis] == Operation.POSITION:
                profile = replace(profile, velocity=kept.get(axis, profile.velocity))
            kept[axis] = profile.velocity
            super().move(axis, target, profile)


class CompleteTooEarly(Mutant):
    breaks = ("AxisDriver.read/complete", "wrong value")
    found_by = "test_profiles.py::test_a_move_shows_what_it_does"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            slow = np.abs(image.velocity_command) < 0.1
            moving = image.operation == Operation.POSITION
            image.motion_complete |= moving & slow


class IdleAtOnceAfterAStop(Mutant):
    breaks = ("AxisDriver.read/states", "wrong value")
    found_by = "test_threads.py::test_commands_to_all_axes_at_once"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.operation[image.operation == Operation.STOPPING] = Operation.IDLE


class QuickStopOfAJogIsGentle(Mutant):
    breaks = ("AxisDriver.quick_stop/starts", "wrong value")
    found_by = "test_stops_of_some_axes.py::test_a_stop_reaches_each_named_axis_of_jogs"

    class Axes(SimAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            jogs = [a for a in axes if self._states.operation[a] == Operation.VELOCITY]
            super().quick_stop([axis for axis in axes if axis not in jogs])
            with self._world.lock:
                self._world.advance()
                for axis in jogs:
                    self._motion.brake(axis, 0.3)


class StopSwitchesTheLastServoOff(Mutant):
    breaks = ("AxisDriver.stop/rests", "side effect")
    found_by = "test_stopping.py::test_a_quick_stop_is_no_slower_than_a_stop"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            super().stop(axes)
            last = self._simulation.axes - 1
            if last in axes:
                with self._world.lock:
                    tick = self._world.tick + 500
                    self._world.at(tick, lambda: self._simulation.power.turn_off(last))


class StreamGoesOnAfterAStop(Mutant):
    breaks = ("AxisDriver.stop/stream", "ignored")
    found_by = "test_stops_of_some_axes.py::test_a_stop_reaches_each_named_axis_of_a_stream"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            streams = [a for a in axes if self._states.operation[a] == Operation.STREAM]
            super().stop(axes)
            with self._world.lock:
                for axis in streams:
                    tick = self._world.tick + 120
                    self._world.at(tick, lambda axis=axis: self._motion.begin_stream(axis))


class JogsAtNineTenths(Mutant):
    breaks = ("AxisDriver.jog/starts", "clipped")
    found_by = "test_units.py::test_a_positive_velocity_raises_the_position"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            super().jog(axis, replace(profile, velocity=0.9 * profile.velocity))


class JogZeroByAcceleration(Mutant):
    breaks = ("AxisDriver.jog/profile", "wrong value")
    found_by = "test_ramps.py::test_a_velocity_command_has_the_ramps_of_its_profile"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            if profile.velocity == 0.0:
                profile = replace(profile, deceleration=profile.acceleration)
            super().jog(axis, profile)


class JogZeroHolds(Mutant):
    """At once, and not with the deceleration of the command."""

    breaks = ("AxisDriver.jog/zero", "wrong value")
    found_by = "test_ramps.py::test_a_velocity_command_has_the_ramps_of_its_profile"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            if profile.velocity == 0.0:
                super().quick_stop([axis])
            else:
                super().jog(axis, profile)


class StreamsWithoutVelocity(Mutant):
    breaks = ("AxisDriver.stream/position", "wrong value")
    found_by = "test_units.py::test_a_streamed_radian_is_a_measured_radian"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            super().stream(
                position, np.where(self._motion.stream.by_velocity, velocity, 0.0), due_ns
            )


class StreamsSwapped(Mutant):
    breaks = ("AxisDriver.begin_stream/follows", "wrong axis")
    found_by = "test_streams.py::test_streams_may_follow_on_each_other"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            order = np.arange(len(position))
            order[:2] = order[1::-1]
            start = self.__dict__["start"]
            super().stream(start + (position - start)[order], velocity[order], due_ns)

        def begin_stream(self, axes: Sequence[int]) -> None:
            self.__dict__["start"] = np.array(self._simulation.servo.command)
            super().begin_stream(axes)


class StreamsClippedToHalfARadian(Mutant):
    """Per second."""

    breaks = ("AxisDriver.stream/position", "clipped")
    found_by = "test_limits.py::test_a_trajectory_at_the_limits_is_followed"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            command = np.array(self._simulation.servo.command)
            step = 0.5 * max(1e-4, (due_ns - self._world.now_ns) * 1e-9)
            clipped = np.clip(position, command - step, command + step)
            super().stream(clipped, np.clip(velocity, -0.5, 0.5), due_ns)


class StreamBeginsWithAJump(Mutant):
    breaks = ("AxisDriver.begin_stream/follows", "wrong value")
    found_by = "test_trajectories.py::test_a_stream_begins_where_the_command_stands"

    class Axes(SimAxes):
        def begin_stream(self, axes: Sequence[int]) -> None:
            with self._world.lock:
                self._world.advance()
                servo = self._simulation.servo
                for axis in axes:
                    here = float(servo.position[axis])
                    servo.place(axis, here, here + 0.004, 0.0)
            super().begin_stream(axes)


class NoStreamsAfterAnAlarm(Mutant):
    breaks = ("AxisDriver.begin_stream/follows", "second call")
    found_by = "test_reopening.py::test_everything_works_again"

    class Axes(SimAxes):
        def clear_alarm(self, axis: int, timeout_s: float) -> None:
            if self._states.amp_alarm[axis]:
                self.__dict__["dead"] = True
            super().clear_alarm(axis, timeout_s)

        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            if not self.__dict__.get("dead"):
                super().stream(position, velocity, due_ns)


class ModeChangesInMotion(Mutant):
    breaks = ("drivers/rejects", "ignored")

    class Axes(SimAxes):
        def set_command_mode(self, axis: int, mode: CommandMode) -> None:
            with self._world.lock:
                self._world.advance()
                if not self._motion.is_idle(axis):
                    self._states.mode[axis] = self._states.mode_feedback[axis] = mode
                    return
            super().set_command_mode(axis, mode)


class HomesInMotion(Mutant):
    breaks = ("drivers/rejects", "ignored")

    class Axes(SimAxes):
        def home(self, axis: int, timeout_s: float) -> None:
            with self._world.lock:
                self._world.advance()
                if not self._motion.is_idle(axis):
                    self._simulation.home(axis)
                    return
            super().home(axis, timeout_s)


class WholeDenominators(Mutant):
    breaks = ("AxisDriver.set_gear_ratio/counts", "wrong value")
    found_by = "test_scaling.py::test_a_gear_ratio_is_a_fraction"

    class Axes(SimAxes):
        def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
            super().set_gear_ratio(axis, float(round(numerator)), float(round(denominator)))


class VelocityIgnoresThePolarity(Mutant):
    breaks = ("AxisDriver.set_polarity/measured", "wrong value")
    found_by = "test_scaling.py::test_a_turned_axis_goes_where_it_is_commanded"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            turned = self._simulation.parameters["AxisPolarity"][: image.axes]
            image.velocity *= turned


class LastVelocityTenPercentMore(Mutant):
    breaks = ("AxisDriver.read/fills", "last axis")
    found_by = "test_profiles.py::test_a_move_keeps_to_its_velocity"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.velocity[-1] *= 1.15


class CommandedVelocityWithoutSign(Mutant):
    breaks = ("AxisDriver.read/commands", "wrong value")
    found_by = "test_units.py::test_the_velocity_is_the_slope_of_the_position"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            np.abs(image.velocity_command, image.velocity_command)


class CommandBesideThePosition(Mutant):
    breaks = ("AxisDriver.read/commands", "wrong value")
    found_by = "test_units.py::test_the_commands_in_the_image_are_those_that_were_given"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.position_command[-1] += 0.004


class TorquesRotated(Mutant):
    breaks = ("AxisDriver.read/torque", "wrong value")
    found_by = "test_feedback.py::test_torque_pushes_the_way_the_axis_accelerates_or_is_not_known"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.torque[:] = np.roll(image.torque, 1)


class CodeForASecond(Mutant):
    breaks = ("AxisDriver.read/alarms", "stale")
    found_by = "test_feedback.py::test_an_alarm_stays_however_long_it_takes"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            since = self.__dict__.setdefault("since", {})
            for axis in range(image.axes):
                if not image.amp_alarm[axis]:
                    since.pop(axis, None)
                elif image.fresh_ns - since.setdefault(axis, image.fresh_ns) > 1_000_000_000:
                    image.alarm_code[axis] = 0


class ReasonWithALineEnd(Mutant):
    breaks = ("AxisDriver.read/alarms", "wrong value")
    found_by = "test_faults.py::test_the_reason_of_an_alarm_comes_and_goes_with_it"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.reason[:] = [text and f"{text}\n" for text in image.reason]


class StampsEverySecondPeriod(Mutant):
    breaks = ("AxisDriver.read/fresh", "stale")
    found_by = "test_feedback.py::test_a_time_stamp_is_that_of_its_values"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            before = image.fresh_ns
            super().read(image)
            count = self.__dict__["count"] = int(self.__dict__.get("count", 0)) + 1
            if count % 8 and before:
                image.fresh_ns = before


class ServoShownOnInAlarm(Mutant):
    breaks = ("AxisDriver.read/states", "wrong value")
    found_by = "test_last_axis.py::test_a_servo_goes_off_in_every_state"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.servo_on |= image.amp_alarm


class HomeSwitchOfTheNext(Mutant):
    breaks = ("AxisDriver.read/switches", "wrong axis")
    found_by = "test_switches.py::test_a_closed_switch_is_shown_alone_until_it_is_released"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.home_switch[:] = np.roll(image.home_switch, 1)


class OperationIsLate(Mutant):
    breaks = ("AxisDriver.read/states", "late")
    found_by = "test_threads.py::test_commands_to_all_axes_at_once"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            queue = self.__dict__.setdefault("queue", deque(maxlen=40))
            queue.append(image.operation.copy())
            image.operation[:] = queue[0]


class AlarmFlickers(Mutant):
    breaks = ("AxisDriver.read/alarms", "side effect")
    found_by = "test_feedback.py::test_an_alarm_stays_however_long_it_takes"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            count = self.__dict__["count"] = int(self.__dict__.get("count", 0)) + 1
            if count % 100 == 0:
                image.amp_alarm[:] = False


class LastModeNotShown(Mutant):
    breaks = ("AxisDriver.read/states", "wrong value")
    found_by = "test_stops_of_some_axes.py::test_a_stop_reaches_each_named_axis_of_jogs"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.mode[-1] = CommandMode.POSITION


class EachClearingLeavesAThread(Mutant):
    breaks = ("AxisDriver.clear_alarm/clears", "side effect")
    found_by = "test_leaks.py::test_no_thread_is_left"

    class Axes(SimAxes):
        def clear_alarm(self, axis: int, timeout_s: float) -> None:
            super().clear_alarm(axis, timeout_s)
            ended = threading.Event()
            threading.Thread(target=ended.wait, args=(30.0,), daemon=True).start()


class EachServoLeavesAHandle(Mutant):
    breaks = ("DeviceDriver.close/disconnects", "leaks")
    found_by = "test_leaks.py::test_no_handle_is_left"

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            super().servo(axis, on, timeout_s)
            os.open(os.devnull, os.O_RDONLY)


class MovesBlockTheLoop(Mutant):
    breaks = ("drivers/timeouts", "blocks")
    found_by = "test_threads.py::test_commands_to_all_axes_at_once"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            with self._world.lock:
                time.sleep(0.05)
            super().move(axis, target, profile)


class MoveOfOneAxisStopsAnother(Mutant):
    breaks = ("AxisDriver.move/starts", "wrong axis")
    found_by = "test_stops_of_some_axes.py::test_a_stop_reaches_each_named_axis_of_a_move"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, profile)
            super().stop([other for other in range(axis) if other == axis - 1])


class EnablingSetsTheCommandLate(Mutant):
    """The command of an enabled axis is right only after 40 ms."""

    breaks = ("AxisDriver.servo/no-jump", "wrong value")
    found_by = "test_enable.py::test_enabling_after_a_move_by_hand_does_not_jump"

    class Axes(ReadAnew):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            self.__dict__.setdefault("old", {})[axis] = (
                self._world.now_ns,
                float(self.__dict__.get("last", np.zeros(self._simulation.axes))[axis]),
            )
            super().servo(axis, on, timeout_s)

        def read(self, image: ProcessImage) -> None:
            super().read(image)
            for axis, (since, command) in self.__dict__.get("old", {}).items():
                if image.servo_on[axis] and image.fresh_ns - since < 40_000_000:
                    image.position_command[axis] = command
                elif not image.servo_on[axis]:
                    continue
            shown = self.__dict__.setdefault("last", np.zeros(image.axes))
            np.copyto(shown, image.position_command, where=image.servo_on)
