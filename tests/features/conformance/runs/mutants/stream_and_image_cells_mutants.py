"""Mutants: Streams and measured values of the last axis, one direction, small, late or stale."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Sequence

import numpy as np
from tests.features.conformance.runs.mutants.plugin import Mutant, ReadAnew

from robotd.api import FloatArray, Operation, ProcessImage
from robotd_sim import SimAxes, SimDevice


class VelocityStreamCoastsToRest(Mutant):
    breaks = ("AxisDriver.end_stream/velocity", "clipped")
    found_by = "test_velocity_commands.py::test_a_velocity_stream_that_ends_slows_to_rest"

    class Axes(SimAxes):
        def end_stream(self, axes: Sequence[int]) -> None:
            by_velocity = [a for a in axes if self._motion.stream.by_velocity[a]]
            following = [a for a in by_velocity if self._motion.stream.following[a]]
            super().end_stream(axes)
            with self._world.lock:
                for axis in following:
                    self._motion.brake(axis, 0.4)


class VelocityStreamEndsHard(Mutant):
    breaks = ("AxisDriver.end_stream/velocity", "wrong value")
    found_by = "test_velocity_commands.py::test_a_velocity_stream_that_ends_slows_to_rest"

    class Axes(SimAxes):
        def end_stream(self, axes: Sequence[int]) -> None:
            following = [a for a in axes if self._motion.stream.following[a]]
            super().end_stream(axes)
            with self._world.lock:
                for axis in following:
                    if self._motion.stream.by_velocity[axis]:
                        self._motion.brake(axis, 100.0)


class LastStreamDoesNotEnd(Mutant):
    breaks = ("AxisDriver.end_stream/moves", "last axis")
    found_by = "test_streams.py::test_groups_of_axes_stream_by_themselves"

    class Axes(SimAxes):
        def end_stream(self, axes: Sequence[int]) -> None:
            super().end_stream([axis for axis in axes if axis < self._simulation.axes - 1])


class EndsEveryStream(Mutant):
    breaks = ("AxisDriver.end_stream/holds", "wrong axis")
    found_by = "test_streams.py::test_groups_of_axes_stream_by_themselves"

    class Axes(SimAxes):
        def end_stream(self, axes: Sequence[int]) -> None:
            super().end_stream(range(self._simulation.axes))


class SecondStreamIgnored(Mutant):
    breaks = ("AxisDriver.begin_stream/follows", "second call")
    found_by = "test_reopening.py::test_everything_works_again"

    class Axes(SimAxes):
        def begin_stream(self, axes: Sequence[int]) -> None:
            self.__dict__["begun"] = self.__dict__.get("begun", 0) + 1
            super().begin_stream(axes)

        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            if self.__dict__.get("begun", 0) != 2:
                super().stream(position, velocity, due_ns)


class StreamsOfTheLastAxisLost(Mutant):
    breaks = ("AxisDriver.begin_stream/follows", "last axis")
    found_by = "test_reopening.py::test_everything_works_again"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            held, still = position.copy(), velocity.copy()
            held[-1], still[-1] = self._simulation.servo.command[-1], 0.0
            super().stream(held, still, due_ns)


class StreamsLostAfterReopen(Mutant):
    breaks = ("AxisDriver.begin_stream/follows", "after re-open")
    found_by = "test_reopening.py::test_everything_works_again"

    class Device(SimDevice):
        def close(self) -> None:
            self.simulation.__dict__["closed"] = True
            super().close()

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            if not self._simulation.__dict__.get("closed"):
                super().stream(position, velocity, due_ns)


class SmallStepsIgnored(Mutant):
    breaks = ("AxisDriver.stream/position", "small")
    found_by = "test_trajectories.py::test_a_canceled_trajectory_stops_within_the_limits"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            command = np.array(self._simulation.servo.command)
            small = np.abs(position - command) < 0.0002
            super().stream(
                np.where(small, command, position), np.where(small, 0.0, velocity), due_ns
            )


class StreamsShortBackwards(Mutant):
    breaks = ("AxisDriver.stream/position", "one direction")
    found_by = "test_streams.py::test_a_setpoint_is_reached_when_it_is_due"

    class Axes(SimAxes):
        def begin_stream(self, axes: Sequence[int]) -> None:
            self.__dict__["start"] = np.array(self._simulation.servo.command)
            super().begin_stream(axes)

        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            start = self.__dict__["start"]
            short = start + 0.95 * (position - start)
            super().stream(np.where(position < start, short, position), velocity, due_ns)


class NanInAStreamRaises(Mutant):
    breaks = ("AxisDriver.stream/nan", "raises")
    found_by = "test_units.py::test_a_streamed_velocity_is_a_measured_velocity"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            if np.isnan(position).any():
                raise ValueError("nan")
            super().stream(position, velocity, due_ns)


class LastVelocityStreamIgnored(Mutant):
    breaks = ("AxisDriver.stream/velocity", "last axis")
    found_by = "test_units.py::test_a_streamed_velocity_is_a_measured_velocity"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            still = velocity.copy()
            if self._motion.stream.by_velocity[-1]:
                still[-1] = 0.0
            super().stream(position, still, due_ns)


class VelocityStreamSlowerBackwards(Mutant):
    breaks = ("AxisDriver.stream/velocity", "one direction")
    found_by = "test_units.py::test_a_streamed_velocity_is_a_measured_velocity"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            slower = (velocity < 0.0) & self._motion.stream.by_velocity
            super().stream(position, np.where(slower, 0.8 * velocity, velocity), due_ns)


class StreamTwoPeriodsLate(Mutant):
    breaks = ("AxisDriver.stream/setpoint", "late")
    found_by = "test_streams.py::test_a_setpoint_is_reached_when_it_is_due"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            queue = self.__dict__.setdefault("queue", deque(maxlen=3))
            if self.__dict__.get("last_ns", 0) + 20_000_000 < due_ns:
                queue.clear()
            self.__dict__["last_ns"] = due_ns
            queue.append((position.copy(), velocity.copy()))
            late, speeds = queue[0]
            super().stream(late, speeds, due_ns)


class OperationNeverStream(Mutant):
    breaks = ("AxisDriver.begin_stream/operation", "wrong value")
    found_by = "test_streams.py::test_a_setpoint_is_reached_when_it_is_due"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.operation[image.operation == Operation.STREAM] = Operation.IDLE


class OperationOfJogsIsAMove(Mutant):
    breaks = ("AxisDriver.read/states", "wrong value")
    found_by = "test_velocity_commands.py::test_a_velocity_command_moves_its_axis_alone"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.operation[image.operation == Operation.VELOCITY] = Operation.POSITION


class StampsTwentyMillisecondsOld(Mutant):
    breaks = ("AxisDriver.read/fresh", "stale")
    found_by = "test_ageing.py::test_a_time_stamp_is_that_of_the_arrival"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.fresh_ns = max(1, self._simulation.world.now_ns - 20_000_000)


class _Delayed(ReadAnew):
    """Shows what was measured ten periods ago, as fresh."""

    NAME = "position"

    def read(self, image: ProcessImage) -> None:
        super().read(image)
        queue = self.__dict__.setdefault("queue", deque(maxlen=11))
        queue.append(getattr(image, self.NAME).copy())
        getattr(image, self.NAME)[:] = queue[0]


class PositionsTwentyMillisecondsOld(Mutant):
    breaks = ("AxisDriver.read/measured", "stale")
    found_by = "test_ageing.py::test_values_are_as_old_as_their_time_stamp"

    class Axes(_Delayed):
        pass


class VelocitiesTwentyMillisecondsOld(Mutant):
    breaks = ("AxisDriver.read/measured", "stale")
    found_by = "test_units.py::test_the_velocity_is_the_slope_of_the_position"

    class Axes(_Delayed):
        NAME = "velocity"


class PositionsInThreeMilliradians(Mutant):
    breaks = ("AxisDriver.read/measured", "small")
    found_by = "test_units.py::test_the_velocity_is_the_slope_of_the_position"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.position[:] = np.rint(image.position / 0.003) * 0.003


class VelocityWithoutSign(Mutant):
    breaks = ("AxisDriver.read/measured", "one direction")
    found_by = "test_units.py::test_the_velocity_is_the_slope_of_the_position"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            np.abs(image.velocity, image.velocity)


class TorqueWithoutSign(Mutant):
    breaks = ("AxisDriver.read/torque", "one direction")
    found_by = "test_feedback.py::test_torque_pushes_the_way_the_axis_accelerates_or_is_not_known"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            np.abs(image.torque, image.torque)


class LastTorqueMissing(Mutant):
    breaks = ("AxisDriver.read/torque", "last axis")
    found_by = "test_feedback.py::test_torque_pushes_the_way_the_axis_accelerates_or_is_not_known"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.torque[-1] = 0.0


class LastAxisIsFrozen(Mutant):
    breaks = ("AxisDriver.read/fills", "last axis")
    found_by = "test_profiles.py::test_a_move_keeps_to_its_velocity"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.velocity[-1] = 0.0


class SecondReadIsEmpty(Mutant):
    """Any image but the first gets positions of 0."""

    breaks = ("AxisDriver.read/fills", "second call")
    found_by = "test_cost.py::test_a_second_image_is_filled_as_the_first"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            first = self.__dict__.setdefault("first", image)
            super().read(image)
            if image is not first:
                image.position[:] = 0.0


class LastAlarmMissing(Mutant):
    breaks = ("AxisDriver.read/alarms", "last axis")
    found_by = "test_last_axis.py::test_an_alarm_of_the_last_axis"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.amp_alarm[-1] = False


class AlarmCodeLatched(Mutant):
    breaks = ("AxisDriver.read/alarms", "stale")
    found_by = "test_faults.py::test_an_alarm_stays_until_it_is_cleared_and_then_nothing_moves"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            kept = self.__dict__.setdefault("kept", np.zeros(image.axes, np.int64))
            np.copyto(kept, image.alarm_code, where=image.alarm_code != 0)
            image.alarm_code[:] = kept


class LastSwitchMissing(Mutant):
    breaks = ("AxisDriver.read/switches", "last axis")
    found_by = "test_last_axis.py::test_a_switch_of_the_last_axis"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.positive_limit[-1] = False


class HomeDoneForgotten(Mutant):
    breaks = ("AxisDriver.read/states", "stale")
    found_by = "test_scaling.py::test_homing_again_makes_the_new_position_zero"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.home_done[-1] = False


class ServoStateLate(Mutant):
    breaks = ("AxisDriver.read/states", "late")
    found_by = "test_enable.py::test_servo_returns_when_the_drive_says_so"

    class Axes(_Delayed):
        NAME = "servo_on"


class CompleteIsOfAllAxes(Mutant):
    breaks = ("AxisDriver.read/complete", "wrong axis")
    found_by = "test_faults.py::test_an_alarm_ends_the_motion_of_its_axis_alone"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.motion_complete[:] = image.motion_complete.any()


class LastDriveNeverOffline(Mutant):
    breaks = ("AxisDriver.read/states", "wrong value")
    found_by = "test_last_axis.py::test_a_lost_last_drive_is_offline_alone"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            if self._simulation.communicating:
                image.offline[-1] = False


class ReadsBlockEveryFiveSeconds(Mutant):
    breaks = ("drivers/loop", "blocks")
    found_by = "test_cost.py::test_no_read_blocks_now_and_then"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            now_ns = self._simulation.clock.now_ns()
            if now_ns > self.__dict__.setdefault("next_ns", now_ns + 5_000_000_000):
                self.__dict__["next_ns"] = now_ns + 5_000_000_000
                time.sleep(0.03)
            super().read(image)


class ReadsFillAList(Mutant):
    breaks = ("drivers/loop", "leaks")
    found_by = "test_process.py::test_a_period_needs_no_room"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            self.__dict__.setdefault("seen", []).append(None)
            super().read(image)


class StreamsFillAList(Mutant):
    breaks = ("drivers/loop", "leaks")
    found_by = "test_process.py::test_a_period_needs_no_room"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            self.__dict__.setdefault("seen", []).append(position.copy())
            super().stream(position, velocity, due_ns)
