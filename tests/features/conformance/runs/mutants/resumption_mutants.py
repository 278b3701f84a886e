"""Mutants: Motion without a command, and commands of one axis that concern others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import CommandMode, NotReady, Operation, ProcessImage, Profile
from robotd_sim import SimAxes, SimDevice

AFTER_END = "test_resumption.py::test_nothing_moves_after_the_end_of_a_motion"
NEW_CONNECTION = "test_resumption.py::test_nothing_moves_after_a_new_connection"
ENDS_ALONE = "test_axes_apart.py::test_one_axis_ends_its_motion_alone"
IDLE_AXIS = "test_axes_apart.py::test_commands_of_an_idle_axis_leave_the_others_alone"
ENABLED = "test_axes_apart.py::test_enabling_changes_no_kind_of_motion"
SLOW = Profile(0.1, 2.0, 2.0)


class StreamsOnceEnabledAgain(Mutant):
    """The stream that the end of the servo has ended is in force again with the servo."""

    breaks = ("AxisDriver/resumption", "side effect")
    found_by = AFTER_END

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            streams = self._states.operation[axis] == Operation.STREAM
            if streams and not on:
                self.__dict__.setdefault("streams", set()).add(axis)
            super().servo(axis, on, timeout_s)
            if on and axis in self.__dict__.get("streams", ()):
                self.__dict__["streams"].discard(axis)
                self.begin_stream([axis])


class LastAxisGoesOnAfterAnAlarm(Mutant):
    """A velocity command of the last axis, when its alarm is cleared and its servo on."""

    breaks = ("AxisDriver/resumption", "last axis")
    found_by = AFTER_END
    says = "axis 2 moves by"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            super().jog(axis, profile)
            self.__dict__.setdefault("jogs", {})[axis] = profile

        def clear_alarm(self, axis: int, timeout_s: float) -> None:
            self.__dict__["cleared"] = bool(self._states.amp_alarm[axis])
            super().clear_alarm(axis, timeout_s)

        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            super().servo(axis, on, timeout_s)
            last = axis == self._simulation.axes - 1
            by_velocity = self._states.mode[axis] == CommandMode.VELOCITY
            if on and last and by_velocity and self.__dict__.pop("cleared", False):
                self.jog(axis, self.__dict__["jogs"].get(axis, SLOW))


class SecondStoppedMoveGoesOn(Mutant):
    """From the second stopped move on, its rest is made once the mode is set."""

    breaks = ("AxisDriver/resumption", "second call")
    found_by = AFTER_END
    says = "the mode is changed to position"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, profile)
            self.__dict__.setdefault("targets", {})[axis] = target

        def stop(self, axes: Sequence[int]) -> None:
            moving = [a for a in axes if self._states.operation[a] == Operation.POSITION]
            super().stop(axes)
            counts = self.__dict__.setdefault("stops", {})
            for axis in moving:
                counts[axis] = counts.get(axis, 0) + 1
                if counts[axis] > 1:
                    self.__dict__.setdefault("rest", set()).add(axis)

        def set_command_mode(self, axis: int, mode: CommandMode) -> None:
            super().set_command_mode(axis, mode)
            if mode is CommandMode.POSITION and axis in self.__dict__.get("rest", ()):
                self.__dict__["rest"].discard(axis)
                if self._states.servo_on[axis]:
                    self.move(axis, self.__dict__["targets"][axis], SLOW)


class FollowsTheNextSetpointWhenEnabled(Mutant):
    """After a stop that went on to servo off, setpoints reach the axis though no stream runs."""

    breaks = ("AxisDriver.stream/others", "wrong axis")
    found_by = AFTER_END

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            stops = self._states.operation[axis] == Operation.STOPPING
            super().servo(axis, on, timeout_s)
            if not on:
                self.__dict__.setdefault("stopped", {})[axis] = stops
            elif self.__dict__.get("stopped", {}).pop(axis, False):
                with self._world.lock:
                    self._motion.stream.begin(axis)


class PositionModeReturnsToTheLastTarget(Mutant):
    breaks = ("AxisDriver.set_command_mode/nothing-moves", "side effect")
    found_by = AFTER_END
    says = "the mode is changed to position"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, profile)
            self.__dict__.setdefault("targets", {})[axis] = target

        def set_command_mode(self, axis: int, mode: CommandMode) -> None:
            changed = self._states.mode[axis] != mode
            super().set_command_mode(axis, mode)
            targets = self.__dict__.get("targets", {})
            on = self._states.servo_on[axis]
            if changed and on and mode is CommandMode.POSITION and axis in targets:
                self.move(axis, targets[axis], SLOW)


class StreamBeginsWithTheLastVelocity(Mutant):
    """A stream of an axis at rest begins with the last velocity of the stream before."""

    breaks = ("AxisDriver.begin_stream/waits", "side effect")
    found_by = AFTER_END

    class Axes(SimAxes):
        def begin_stream(self, axes: Sequence[int]) -> None:
            before = list(self._motion.stream.velocity)
            super().begin_stream(axes)
            with self._world.lock:
                for axis in axes:
                    position = float(self._simulation.servo.command[axis])
                    self._simulation.servo.follow(
                        axis, self._world.tick, position, before[axis], 0.0
                    )


class RunsOnAfterARestart(Mutant):
    """A velocity command of before goes on when the servo is switched on in the next connection."""

    breaks = ("DeviceDriver.start_communication/nothing-moves", "survives close")
    found_by = NEW_CONNECTION

    class Device(SimDevice):
        def stop_communication(self, timeout_s: float) -> None:
            simulation = self.simulation
            jogs = np.flatnonzero(simulation.states.operation == Operation.VELOCITY)
            simulation.__dict__["ran"] = {
                int(axis): float(simulation.servo.command_velocity[axis]) for axis in jogs
            }
            super().stop_communication(timeout_s)

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            super().servo(axis, on, timeout_s)
            speed = self._simulation.__dict__.get("ran", {}).pop(axis, 0.0)
            if on and speed:
                self.jog(axis, Profile(speed, 2.0, 2.0))


class MovesOnAfterALostLink(Mutant):
    breaks = ("AxisDriver/resumption", "after re-open")
    found_by = NEW_CONNECTION
    says = "without a command after a move"

    class Device(SimDevice):
        def start_communication(self, timeout_s: float) -> None:
            super().start_communication(timeout_s)
            self.simulation.__dict__["moves"] = self.simulation.__dict__.pop("targets", {})

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, profile)
            self._simulation.__dict__.setdefault("targets", {})[axis] = target

        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            super().servo(axis, on, timeout_s)
            targets = self._simulation.__dict__.get("moves", {})
            if on and axis in targets and self._states.mode[axis] == CommandMode.POSITION:
                self.move(axis, targets.pop(axis), SLOW)


class EnablingStopsAVelocityCommand(Mutant):
    breaks = ("AxisDriver.servo/enabled", "side effect")
    found_by = ENABLED
    says = "enabled once more"

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            if on and self._states.operation[axis] == Operation.VELOCITY:
                self.stop([axis])
            super().servo(axis, on, timeout_s)


class ClearingEndsAStream(Mutant):
    breaks = ("AxisDriver.clear_alarm/idle", "side effect")
    found_by = ENABLED

    class Axes(SimAxes):
        def clear_alarm(self, axis: int, timeout_s: float) -> None:
            if self._motion.stream.by_velocity[axis]:
                self.end_stream([axis])
            super().clear_alarm(axis, timeout_s)


class ClearingStopsEveryMotion(Mutant):
    breaks = ("AxisDriver.clear_alarm/idle", "side effect")
    found_by = ENABLED
    says = "STOPPING shown in a .* no alarm cleared"

    class Axes(SimAxes):
        def clear_alarm(self, axis: int, timeout_s: float) -> None:
            self.stop([axis])
            super().clear_alarm(axis, timeout_s)


class TheEndOfNoStreamStopsAMove(Mutant):
    breaks = ("AxisDriver.end_stream/idle", "side effect")
    found_by = ENABLED
    says = "a stream of the others is ended"

    class Axes(SimAxes):
        def end_stream(self, axes: Sequence[int]) -> None:
            self.stop([a for a in axes if self._states.operation[a] == Operation.POSITION])
            super().end_stream(axes)


class ModeChangeStopsAll(Mutant):
    breaks = ("AxisDriver/others", "side effect")
    found_by = IDLE_AXIS
    says = "change_mode"

    class Axes(SimAxes):
        def set_command_mode(self, axis: int, mode: CommandMode) -> None:
            super().set_command_mode(axis, mode)
            self.stop(range(self._simulation.axes))


class StreamsOfOthersBeginAnew(Mutant):
    """To begin a stream ends those that run."""

    breaks = ("AxisDriver.begin_stream/follows", "wrong axis")
    found_by = IDLE_AXIS

    class Axes(SimAxes):
        def begin_stream(self, axes: Sequence[int]) -> None:
            following = np.flatnonzero(self._motion.stream.following).tolist()
            self.end_stream([axis for axis in following if axis not in axes])
            super().begin_stream(axes)


class ServoOffStopsTheFirstJog(Mutant):
    """Of another axis."""

    breaks = ("AxisDriver/others", "wrong axis")
    found_by = ENDS_ALONE
    says = "jog"

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            super().servo(axis, on, timeout_s)
            jogs = np.flatnonzero(self._states.operation == Operation.VELOCITY)
            if not on:
                self.stop(jogs[:1].tolist())


class FirstServoSwitchesTheNext(Mutant):
    """On; they go off one by one."""

    breaks = ("AxisDriver.servo_groups/groups", "wrong value")
    found_by = "test_axes_apart.py::test_each_servo_is_switched_on_alone"
    says = "has switched on axes"

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            super().servo(axis, on, timeout_s)
            if on and axis == 0:
                super().servo(1, on, timeout_s)


class CommandRoundedAtEnabling(Mutant):
    """To 5 mrad."""

    breaks = ("AxisDriver.servo/no-jump", "small")
    found_by = "test_hand_moves.py::test_a_small_move_by_hand_is_kept_at_enabling"

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            was_on = self._states.servo_on[axis]
            super().servo(axis, on, timeout_s)
            with self._world.lock:
                command = float(self._simulation.servo.command[axis])
                if on and not was_on:
                    self._motion.hold(axis, round(command / 0.005) * 0.005)


class ClearsTheAlarmsBelow(Mutant):
    breaks = ("AxisDriver.clear_alarm/clears", "wrong axis")
    found_by = "test_axes_apart.py::test_alarms_of_all_axes_are_cleared_one_by_one"

    class Axes(SimAxes):
        def clear_alarm(self, axis: int, timeout_s: float) -> None:
            for other in range(axis + 1):
                super().clear_alarm(other, timeout_s)


class ReturnsToBeforeHoming(Mutant):
    """The command of before homing, when the mode is changed to position."""

    breaks = ("AxisDriver.home/no-motion", "side effect")
    found_by = "test_resumption.py::test_nothing_moves_after_homing"

    class Axes(SimAxes):
        def home(self, axis: int, timeout_s: float) -> None:
            self.__dict__.setdefault("before", {})[axis] = float(
                self._simulation.servo.command[axis]
            )
            super().home(axis, timeout_s)

        def set_command_mode(self, axis: int, mode: CommandMode) -> None:
            super().set_command_mode(axis, mode)
            before = self.__dict__.get("before", {})
            if mode is CommandMode.POSITION and axis in before:
                self.move(axis, before.pop(axis), SLOW)


class ALostDriveGoesOn(Mutant):
    """With its velocity command, when it is back and enabled."""

    breaks = ("AxisDriver/resumption", "survives close")
    found_by = NEW_CONNECTION
    says = "without a command after a jog"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            super().jog(axis, profile)
            self.__dict__.setdefault("jogs", {})[axis] = profile

        def stop(self, axes: Sequence[int]) -> None:
            super().stop(axes)
            for axis in axes:
                if self._states.connected[axis] and self._states.servo_on[axis]:
                    self.__dict__.setdefault("jogs", {}).pop(axis, None)

        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            was_home = self._states.home_done[axis]
            super().servo(axis, on, timeout_s)
            if not on or was_home or self._states.mode[axis] != CommandMode.VELOCITY:
                self.__dict__.setdefault("jogs", {}).pop(axis, None)
            elif axis in self.__dict__.get("jogs", {}):
                super().jog(axis, self.__dict__["jogs"].pop(axis))


class AStreamBegunAgainStops(Mutant):
    breaks = ("AxisDriver.begin_stream/again", "side effect")
    found_by = ENABLED
    says = "begun once more"

    class Axes(SimAxes):
        def begin_stream(self, axes: Sequence[int]) -> None:
            self.stop([axis for axis in axes if self._motion.stream.following[axis]])
            super().begin_stream(axes)


class StreamsThoseThatCan(Mutant):
    breaks = ("AxisDriver.begin_stream/all", "ignored")
    found_by = "test_axes_apart.py::test_a_stream_of_an_axis_that_is_off_begins_for_none"
    says = "is in STREAM"

    class Axes(SimAxes):
        def begin_stream(self, axes: Sequence[int]) -> None:
            for axis in sorted(axes, key=lambda axis: not self._states.servo_on[axis]):
                super().begin_stream([axis])


class CommandOfTheConnectionBefore(Mutant):
    breaks = ("AxisDriver.servo/no-jump", "after re-open")
    found_by = "test_hand_moves.py::test_a_move_by_hand_between_two_connections_is_kept_at_enabling"
    says = "was moved by"

    class Device(SimDevice):
        def stop_communication(self, timeout_s: float) -> None:
            super().stop_communication(timeout_s)
            simulation = self.simulation
            simulation.__dict__["kept"] = dict(enumerate(simulation.servo.command.tolist()))

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            super().servo(axis, on, timeout_s)
            kept = self._simulation.__dict__.get("kept", {})
            if on and axis in kept:
                with self._world.lock:
                    self._motion.hold(axis, kept.pop(axis))


class RejectedMovesAreMadeOnceEnabled(Mutant):
    """A move that is rejected, as the servo is off, stays in a register of the drive."""

    breaks = ("AxisDriver/resumption", "side effect")
    found_by = "test_resumption.py::test_a_command_that_was_rejected_is_forgotten"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            try:
                super().move(axis, target, profile)
            except NotReady:
                self.__dict__.setdefault("latched", {})[axis] = target, profile
                raise

        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            super().servo(axis, on, timeout_s)
            if on and axis in self.__dict__.get("latched", {}):
                super().move(axis, *self.__dict__["latched"].pop(axis))


class VelocityCommandsExpire(Mutant):
    """A velocity command ends after two seconds, as if it had to be repeated."""

    breaks = ("AxisDriver.jog/starts", "clipped")
    found_by = "test_velocity_commands.py::test_a_velocity_command_does_not_expire"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            super().jog(axis, profile)
            self.__dict__.setdefault("begun", {})[axis] = self._simulation.clock.now_ns()

        def read(self, image: ProcessImage) -> None:
            super().read(image)
            for axis, begun_ns in [*self.__dict__.get("begun", {}).items()]:
                if self._simulation.clock.now_ns() > begun_ns + 2_000_000_000:
                    self.__dict__["begun"].pop(axis)
                    self.stop([axis])


class DrivesThatAreOffAreNeverOffline(Mutant):
    """A drive is looked for only while its servo is on."""

    breaks = ("AxisDriver.read/states", "stale")
    found_by = "test_lost_nodes.py::test_a_drive_whose_servo_is_off_is_lost_as_well"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            was_off = ~image.servo_on & ~image.offline
            super().read(image)
            image.offline &= ~was_off
