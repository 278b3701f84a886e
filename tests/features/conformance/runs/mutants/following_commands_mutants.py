"""Mutants: Commands that follow on another, and take something from the one before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import Operation, Profile, profile_to_velocity
from robotd_sim import SimAxes

OVERRIDES = "test_overrides.py::test_a_move_that_overrides_another_has_its_own_ramps"
JOGS = "test_overrides.py::test_each_change_of_a_velocity_command_has_its_own_ramps"
IN_TURN = "test_overrides.py::test_moves_and_velocity_commands_in_turn_have_their_own_ramps"
LAST_MOVE = "test_stop_ramps.py::test_a_stop_has_the_ramp_of_the_last_move"
LAST_JOG = "test_stop_ramps.py::test_a_stop_has_the_ramp_of_the_last_velocity_command"
MANY_MOVES = "test_command_sequences.py::test_the_last_of_many_moves_counts"


class Remembers(SimAxes):
    """Axes that know the profile of each running command."""

    def runs(self, axis: int) -> bool:
        return self._states.operation[axis] in (Operation.POSITION, Operation.VELOCITY)

    def profile_before(self, axis: int, profile: Profile) -> Profile:
        """Return the profile of the running command; ``profile`` where nothing runs."""
        known: dict[int, Profile] = self.__dict__.setdefault("known", {})
        before = known.get(axis, profile) if self.runs(axis) else profile
        known[axis] = profile
        return before


class OverrideSpeedsUpAsBefore(Mutant):
    breaks = ("AxisDriver.move/new-profile", "ignored")
    found_by = OVERRIDES
    says = "acceleration"

    class Axes(Remembers):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            before = self.profile_before(axis, profile)
            super().move(axis, target, replace(profile, acceleration=before.acceleration))


class LastAxisKeepsItsProfile(Mutant):
    breaks = ("AxisDriver.move/new-profile", "last axis")
    found_by = OVERRIDES

    class Axes(Remembers):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            before = self.profile_before(axis, profile)
            super().move(axis, target, before if axis == self._simulation.axes - 1 else profile)


class OverrideToTheSameTargetIgnored(Mutant):
    breaks = ("AxisDriver.move/overrides", "ignored")
    found_by = OVERRIDES

    class Axes(Remembers):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            goals: dict[int, float] = self.__dict__.setdefault("goals", {})
            if not self.runs(axis) or goals.get(axis) != target:
                super().move(axis, target, profile)
            goals[axis] = target


class TurnBrakesAsBefore(Mutant):
    """A move back slows down to its turn by the deceleration of the move before."""

    breaks = ("AxisDriver.move/new-profile", "one direction")
    found_by = OVERRIDES
    says = "where it turns"

    class Axes(Remembers):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            before = self.profile_before(axis, profile)
            speed = float(self._simulation.servo.command_velocity[axis])
            away = target - float(self._simulation.servo.command[axis])
            turns = speed * away < 0.0
            super().move(axis, target, before if turns else profile)


class SecondOverrideIgnored(Mutant):
    """A move takes over from one that has begun; not from one that has taken over itself."""

    breaks = ("AxisDriver.move/overrides", "ignored")
    found_by = MANY_MOVES

    class Axes(Remembers):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            taken: set[int] = self.__dict__.setdefault("taken", set())
            if not self.runs(axis):
                taken.discard(axis)
            elif axis in taken:
                return
            else:
                taken.add(axis)
            super().move(axis, target, profile)


class JogSlowsDownAsBefore(Mutant):
    breaks = ("AxisDriver.jog/new-profile", "ignored")
    found_by = JOGS
    says = "deceleration"

    class Axes(Remembers):
        def jog(self, axis: int, profile: Profile) -> None:
            before = self.profile_before(axis, profile)
            slower = abs(profile.velocity) < abs(before.velocity)
            ramp = before.deceleration if slower else profile.deceleration
            super().jog(axis, replace(profile, deceleration=ramp))


class LastJogSpeedsUpAsBefore(Mutant):
    breaks = ("AxisDriver.jog/new-profile", "last axis")
    found_by = JOGS
    says = "acceleration"

    class Axes(Remembers):
        def jog(self, axis: int, profile: Profile) -> None:
            before = self.profile_before(axis, profile)
            if axis == self._simulation.axes - 1:
                profile = replace(profile, acceleration=before.acceleration)
            super().jog(axis, profile)


class JogTurnsByItsAcceleration(Mutant):
    breaks = ("AxisDriver.jog/new-profile", "one direction")
    found_by = JOGS
    says = "where it turns"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            speed = float(self._simulation.servo.command_velocity[axis])
            if speed * profile.velocity < 0.0:
                profile = replace(profile, deceleration=profile.acceleration)
            super().jog(axis, profile)


class JogHasTheRampsOfTheMoveBefore(Mutant):
    breaks = ("AxisDriver.jog/profile", "second call")
    found_by = IN_TURN

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, profile)
            self.__dict__.setdefault("moves", {})[axis] = profile

        def jog(self, axis: int, profile: Profile) -> None:
            move = self.__dict__.setdefault("moves", {}).get(axis, profile)
            super().jog(axis, replace(move, velocity=profile.velocity))


class StopHasTheRampOfTheLastAxis(Mutant):
    breaks = ("AxisDriver.stop/ramp", "wrong value")
    found_by = (LAST_MOVE, LAST_JOG)

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            ramps = self._motion._deceleration
            for axis in axes[:-1]:
                ramps[axis] = ramps[axes[-1]]
            super().stop(axes)


class StopAsHardAsTheQuickStopBefore(Mutant):
    breaks = ("AxisDriver.stop/ramp", "second call")
    found_by = LAST_MOVE

    class Axes(SimAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            self.__dict__.setdefault("quick", set()).update(axes)
            super().quick_stop(axes)

        def stop(self, axes: Sequence[int]) -> None:
            for axis in self.__dict__.get("quick", set()) & set(axes):
                self._motion._deceleration[axis] = 9.0
            super().stop(axes)


class StopAfterAnOverrideIsTheFirstMoves(Mutant):
    breaks = ("AxisDriver.move/new-profile", "ignored")
    found_by = LAST_MOVE

    class Axes(Remembers):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            first: dict[int, float] = self.__dict__.setdefault("first", {})
            if not self.runs(axis):
                first[axis] = profile.deceleration
            super().move(axis, target, profile)

        def stop(self, axes: Sequence[int]) -> None:
            for axis in axes:
                if self._states.operation[axis] == Operation.POSITION:
                    self._motion._deceleration[axis] = self.__dict__["first"][axis]
            super().stop(axes)


class MovesOfAStoppingAxisLost(Mutant):
    breaks = ("AxisDriver.move/while-stopping", "ignored")
    found_by = "test_overrides.py::test_a_move_during_a_stop_is_rejected_or_made"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            if self._states.operation[axis] != Operation.STOPPING:
                super().move(axis, target, profile)


class JogChangesLate(Mutant):
    """A change of a running velocity command begins 150 ms later."""

    breaks = ("AxisDriver.jog/changes", "late")
    found_by = "test_command_sequences.py::test_a_change_of_a_velocity_command_takes_effect_at_once"

    class Axes(Remembers):
        def jog(self, axis: int, profile: Profile) -> None:
            if not self.runs(axis):
                super().jog(axis, profile)
                return
            number, ticks = self._motion.plan(axis), round(0.15 / self._simulation.servo.tick_s)

            def later() -> None:
                if self._motion.plan(axis) == number:
                    self._motion.jog(axis, profile)

            with self._world.lock:
                self._world.advance()
                self._world.at(self._world.tick + ticks, later)


class TargetTooNearIsPassed(Mutant):
    """Too fast to stop there, the axis stops where it can."""

    breaks = ("AxisDriver.move/target", "wrong value")
    found_by = "test_command_sequences.py::test_a_target_too_near_to_stop_at_is_reached"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            servo = self._simulation.servo
            here, speed = float(servo.command[axis]), float(servo.command_velocity[axis])
            segments = profile_to_velocity(
                here, speed, 0.0, profile.acceleration, profile.deceleration
            )
            rest = segments[-1].position
            passed = (rest - target) * np.sign(speed) > 0.0 and (target - here) * speed > 0.0
            super().move(axis, rest if passed else target, profile)


class JogIgnoredWhileItSpeedsUp(Mutant):
    breaks = ("AxisDriver.jog/changes", "ignored")
    found_by = "test_command_sequences.py::test_the_last_of_many_velocity_commands_counts"

    class Axes(Remembers):
        def jog(self, axis: int, profile: Profile) -> None:
            servo = self._simulation.servo
            rises = float(servo.command_velocity[axis] * servo.command_acceleration[axis]) > 0.0
            if not (self.runs(axis) and rises):
                super().jog(axis, profile)


class MoveAfterAStopIsSlow(Mutant):
    breaks = ("AxisDriver.move/profile", "second call")
    found_by = "test_stop_ramps.py::test_a_move_after_a_stop_has_its_own_profile"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            self.__dict__.setdefault("stopped", set()).update(axes)
            super().stop(axes)

        def move(self, axis: int, target: float, profile: Profile) -> None:
            stopped: set[int] = self.__dict__.setdefault("stopped", set())
            if axis in stopped:
                stopped.discard(axis)
                profile = replace(profile, velocity=0.6 * profile.velocity)
            super().move(axis, target, profile)
