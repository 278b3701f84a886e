"""Mutants: Images that contradict themselves, and the finest and fastest motions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from tests.features.conformance.runs.mutants.plugin import Mutant, ReadAnew

from robotd.api import Operation, ProcessImage, Profile
from robotd_sim import SimAxes

MOVE = "test_shown_motion.py::test_each_read_of_a_move_agrees_with_itself"
JOG = "test_shown_motion.py::test_each_read_of_a_velocity_command_agrees_with_itself"
STREAM = "test_shown_motion.py::test_each_read_of_a_stream_agrees_with_itself"
LONG = "test_extremes.py::test_a_long_move_reaches_its_speed_in_both_directions"


class CompleteUntilTheNextMove(Mutant):
    """A velocity command leaves it as it was."""

    breaks = ("AxisDriver.read/complete", "stale")
    found_by = JOG
    says = "motion_complete while it executes"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            before, fresh_ns = image.motion_complete.copy(), image.fresh_ns
            super().read(image)
            if fresh_ns:
                jogs = image.operation == Operation.VELOCITY
                np.copyto(image.motion_complete, before, where=jogs)


class CompleteInStreams(Mutant):
    breaks = ("AxisDriver.read/complete", "wrong value")
    found_by = STREAM
    says = "motion_complete while it executes"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.motion_complete[image.operation == Operation.STREAM] = True


class CompleteWhenItSlowsDown(Mutant):
    breaks = ("AxisDriver.read/complete", "wrong value")
    found_by = MOVE
    says = "motion_complete while it executes"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            slow = np.abs(image.velocity_command) < 0.05
            image.motion_complete[slow & (image.operation == Operation.POSITION)] = True


class IdleWithItsLastVelocity(Mutant):
    """The velocity command of the last axis keeps the value of its last motion."""

    breaks = ("AxisDriver.read/commands", "wrong value")
    found_by = (MOVE, JOG, STREAM)
    says = "idle with a velocity command"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            if image.operation[-1] != Operation.IDLE:
                self.__dict__["speed"] = float(image.velocity_command[-1])
            elif image.servo_on[-1]:
                image.velocity_command[-1] = self.__dict__.get("speed", 0.0)


class TargetShownAsTheCommand(Mutant):
    """After a stop the position command is the target that was not reached."""

    breaks = ("AxisDriver.read/commands", "wrong value")
    found_by = MOVE
    says = "not where it is"

    class Axes(ReadAnew):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, profile)
            self.__dict__.setdefault("goals", {})[axis] = target

        def read(self, image: ProcessImage) -> None:
            super().read(image)
            for axis, goal in self.__dict__.get("goals", {}).items():
                idle = image.operation[axis] == Operation.IDLE and image.servo_on[axis]
                if idle and not image.motion_complete[axis]:
                    image.position_command[axis] = goal


class DifferenceOfPositions(Mutant):
    """The measured velocity is the difference of two shown positions."""

    breaks = ("AxisDriver.read/measured", "wrong value")
    found_by = (
        "test_shown_motion.py::test_homing_shows_no_velocity",
        "test_shown_motion.py::test_a_change_of_scale_shows_no_velocity",
    )
    says = "in a read"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            before, then_ns = image.position.copy(), image.fresh_ns
            super().read(image)
            passed_s = (image.fresh_ns - then_ns) * 1e-9
            if then_ns and passed_s > 0.0 and np.isfinite(before).all():
                image.velocity[:] = (image.position - before) / passed_s


class FineMovesLeftOut(Mutant):
    breaks = ("AxisDriver.move/starts", "small")
    found_by = "test_extremes.py::test_the_finest_moves_are_made"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            here = float(self._simulation.servo.command[axis])
            super().move(axis, here if abs(target - here) < 7e-5 else target, profile)


class TargetsInTenthsOfAMilliradian(Mutant):
    breaks = ("AxisDriver.move/target", "small")
    found_by = "test_extremes.py::test_the_finest_moves_are_made"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, round(target, 4), profile)


class SlowJogsStand(Mutant):
    breaks = ("AxisDriver.jog/starts", "small")
    found_by = "test_extremes.py::test_the_slowest_velocity_command_is_executed"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            slow = abs(profile.velocity) < 0.005
            super().jog(axis, replace(profile, velocity=0.0) if slow else profile)


class LeastRamp(Mutant):
    """Ramps below 0.4 rad/s² are raised to it."""

    breaks = ("AxisDriver.move/profile", "small")
    found_by = "test_extremes.py::test_a_gentle_move_is_as_gentle_as_it_was_asked_for"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            ramps = max(profile.acceleration, 0.4), max(profile.deceleration, 0.4)
            super().move(axis, target, Profile(profile.velocity, *ramps))


class SpeedClippedForth(Mutant):
    breaks = ("AxisDriver.move/profile", "one direction")
    found_by = LONG

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            if target > float(self._simulation.servo.command[axis]):
                profile = replace(profile, velocity=min(profile.velocity, 1.7))
            super().move(axis, target, profile)


class RampsClippedBack(Mutant):
    breaks = ("AxisDriver.move/profile", "one direction")
    found_by = LONG

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            if target < float(self._simulation.servo.command[axis]):
                hardest = min(profile.deceleration, 7.0)
                profile = replace(profile, deceleration=hardest)
            super().move(axis, target, profile)


class ExecutingLongAfterTheEnd(Mutant):
    breaks = ("AxisDriver.read/states", "late")
    found_by = MOVE
    says = "after the end of its command"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            last: dict[int, tuple[int, int]] = self.__dict__.setdefault("last", {})
            for axis in range(image.axes):
                operation, now_ns = int(image.operation[axis]), image.fresh_ns
                if operation != Operation.IDLE:
                    last[axis] = operation, now_ns
                elif axis in last and 0 <= now_ns - last[axis][1] < 700_000_000:
                    image.operation[axis] = last[axis][0]
                    image.motion_complete[axis] = False


class JogClippedBack(Mutant):
    breaks = ("AxisDriver.jog/starts", "clipped")
    found_by = "test_extremes.py::test_a_velocity_command_near_the_limits_is_not_clipped"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            super().jog(axis, replace(profile, velocity=max(profile.velocity, -1.4)))


class RampsOfJogsClipped(Mutant):
    breaks = ("AxisDriver.jog/profile", "clipped")
    found_by = "test_extremes.py::test_a_velocity_command_near_the_limits_is_not_clipped"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            ramps = min(profile.acceleration, 7.0), min(profile.deceleration, 7.0)
            super().jog(axis, Profile(profile.velocity, *ramps))
