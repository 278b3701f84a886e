"""Mutants: Moves, modes, homing and scales that fail once, backwards, when small, at one axis."""

from __future__ import annotations

from dataclasses import replace

from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import CommandMode, Operation, Profile
from robotd_sim import SimAxes


class SmallMovesIgnored(Mutant):
    breaks = ("AxisDriver.move/starts", "small")
    found_by = "test_small_and_large.py::test_small_moves_add_up"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            if abs(target - float(self._simulation.servo.command[axis])) > 0.0019:
                super().move(axis, target, profile)


class AccelerationClippedAtFive(Mutant):
    breaks = ("AxisDriver.move/profile", "clipped")
    found_by = "test_small_and_large.py::test_a_move_near_the_limits_is_not_clipped"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            clipped = min(profile.acceleration, 5.0)
            super().move(axis, target, replace(profile, acceleration=clipped))


class AccelerationThreeQuarters(Mutant):
    breaks = ("AxisDriver.move/profile", "clipped")
    found_by = "test_ramps.py::test_a_move_has_the_ramps_of_its_profile"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, replace(profile, acceleration=0.75 * profile.acceleration))


class ProfileOfTheFirstMove(Mutant):
    breaks = ("AxisDriver.move/profile", "second call")
    found_by = "test_ramps.py::test_a_move_has_the_ramps_of_its_profile"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            first = self.__dict__.setdefault(f"first{axis}", profile)
            super().move(axis, target, replace(profile, deceleration=first.deceleration))


class LastAxisIsSlower(Mutant):
    breaks = ("AxisDriver.move/profile", "last axis")
    found_by = "test_profiles.py::test_a_move_keeps_to_its_velocity"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            share = 0.75 if axis == self._simulation.axes - 1 else 1.0
            super().move(axis, target, replace(profile, velocity=share * profile.velocity))


class SlowerBackwards(Mutant):
    breaks = ("AxisDriver.move/profile", "one direction")
    found_by = "test_ramps.py::test_a_move_has_the_ramps_of_its_profile"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            back = target < float(self._simulation.servo.command[axis])
            share = 0.75 if back else 1.0
            super().move(axis, target, replace(profile, acceleration=share * profile.acceleration))


class SlowestSpeed(Mutant):
    breaks = ("AxisDriver.move/profile", "wrong value")
    found_by = "test_small_and_large.py::test_a_slow_move_is_as_slow_as_it_was_asked_for"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, replace(profile, velocity=max(profile.velocity, 0.1)))


class MoveWaits(Mutant):
    breaks = ("AxisDriver.move/starts", "blocks")
    found_by = "test_reopening.py::test_everything_works_again"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, profile)
            self._wait(lambda: not self._world.moves(axis), 5.0)


class MoveWorksOnceBackwards(Mutant):
    breaks = ("AxisDriver.move/starts", "second call")
    found_by = "test_stops_of_some_axes.py::test_a_stop_reaches_each_named_axis_of_a_move"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            here = float(self._simulation.servo.command[axis])
            if abs(target - self.__dict__.get(f"target{axis}", here - 1.0)) > 1e-9:
                super().move(axis, target, profile)
            self.__dict__[f"target{axis}"] = target


class TargetsInFiveMilliradians(Mutant):
    breaks = ("AxisDriver.move/starts", "small")
    found_by = "test_small_and_large.py::test_small_moves_add_up"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, round(target * 400.0) / 400.0, profile)


class LessBackwards(Mutant):
    breaks = ("AxisDriver.move/target", "one direction")
    found_by = "test_ramps.py::test_a_radian_is_a_radian_far_from_zero_and_beyond_a_turn"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            here = float(self._simulation.servo.command[axis])
            super().move(axis, target if target > here else here + 0.97 * (target - here), profile)


class SlowJogsIgnored(Mutant):
    breaks = ("AxisDriver.jog/starts", "small")
    found_by = "test_velocity_commands.py::test_a_slow_velocity_command_is_executed"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            slow = abs(profile.velocity) < 0.05
            super().jog(axis, replace(profile, velocity=0.0) if slow else profile)


class JogChangesIgnored(Mutant):
    breaks = ("AxisDriver.jog/changes", "ignored")
    found_by = "test_velocity_commands.py::test_a_velocity_command_is_changed_without_a_jump"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            if self._states.operation[axis] != Operation.VELOCITY or profile.velocity == 0.0:
                super().jog(axis, profile)


class SlightJogChangesIgnored(Mutant):
    """A dead band of 5 % keeps the velocity of a running command."""

    breaks = ("AxisDriver.jog/changes", "ignored")
    found_by = "test_velocity_commands.py::test_a_slight_change_of_a_velocity_command_is_made"
    says = "its speed changes by"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            speed = float(self._simulation.servo.command_velocity[axis])
            if not 0.0 < abs(profile.velocity - speed) < 0.05 * abs(speed):
                super().jog(axis, profile)


class JogsSlowerBackwards(Mutant):
    breaks = ("AxisDriver.jog/starts", "one direction")
    found_by = "test_reopening.py::test_everything_works_again"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            share = 0.85 if profile.velocity < 0.0 else 1.0
            super().jog(axis, replace(profile, velocity=share * profile.velocity))


class JogsTheFirstAsWell(Mutant):
    breaks = ("AxisDriver.jog/starts", "wrong axis")
    found_by = "test_velocity_commands.py::test_a_velocity_command_moves_its_axis_alone"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            super().jog(axis, profile)
            if axis and self._states.operation[0] == Operation.IDLE:
                super().jog(0, profile)


class CreepsAtZero(Mutant):
    breaks = ("AxisDriver.jog/zero", "wrong value")
    found_by = "test_velocity_commands.py::test_a_velocity_command_moves_its_axis_alone"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            creep = profile.velocity or 0.004
            super().jog(axis, replace(profile, velocity=creep))


class RampsOfTheFirstJog(Mutant):
    breaks = ("AxisDriver.jog/profile", "second call")
    found_by = "test_small_and_large.py::test_each_velocity_command_has_its_own_ramps"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            first = self.__dict__.setdefault(f"first{axis}", profile)
            super().jog(axis, replace(profile, acceleration=first.acceleration))


class JogRampsBackwards(Mutant):
    breaks = ("AxisDriver.jog/profile", "one direction")
    found_by = "test_ramps.py::test_a_velocity_command_has_the_ramps_of_its_profile"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            share = 0.6 if profile.velocity < 0.0 else 1.0
            super().jog(axis, replace(profile, acceleration=share * profile.acceleration))


class LastModeIgnored(Mutant):
    breaks = ("AxisDriver.set_command_mode/changes", "last axis")
    found_by = "test_reopening.py::test_everything_works_again"

    class Axes(SimAxes):
        def set_command_mode(self, axis: int, mode: CommandMode) -> None:
            if axis < self._simulation.axes - 1:
                super().set_command_mode(axis, mode)


class ModeWorksOnce(Mutant):
    breaks = ("AxisDriver.set_command_mode/changes", "second call")
    found_by = "test_reopening.py::test_everything_works_again"

    class Axes(SimAxes):
        def set_command_mode(self, axis: int, mode: CommandMode) -> None:
            done = self.__dict__.setdefault("done", set())
            if mode is CommandMode.POSITION or axis not in done:
                super().set_command_mode(axis, mode)
            if mode is CommandMode.VELOCITY:
                done.add(axis)


class ModeChangeMoves(Mutant):
    breaks = ("AxisDriver.set_command_mode/nothing-moves", "side effect")
    found_by = "test_velocity_commands.py::test_changing_the_mode_moves_nothing"

    class Axes(SimAxes):
        def set_command_mode(self, axis: int, mode: CommandMode) -> None:
            super().set_command_mode(axis, mode)
            if mode is CommandMode.POSITION:
                with self._world.lock:
                    here = float(self._simulation.servo.command[axis])
                    self._motion.move(axis, here + 0.005, Profile(0.2, 4.0, 4.0))


class SecondHomingIgnored(Mutant):
    breaks = ("AxisDriver.home/zero", "second call")
    found_by = "test_scaling.py::test_homing_again_makes_the_new_position_zero"

    class Axes(SimAxes):
        def home(self, axis: int, timeout_s: float) -> None:
            if not self._states.home_done[axis]:
                super().home(axis, timeout_s)


class LastHomingIgnored(Mutant):
    breaks = ("AxisDriver.home/zero", "last axis")
    found_by = "test_scaling.py::test_homing_again_makes_the_new_position_zero"

    class Axes(SimAxes):
        def home(self, axis: int, timeout_s: float) -> None:
            if axis < self._simulation.axes - 1:
                super().home(axis, timeout_s)
            self._states.home_done[axis] = True


class HomingMoves(Mutant):
    breaks = ("AxisDriver.home/no-motion", "side effect")
    found_by = "test_units.py::test_homing_makes_the_position_zero_and_moves_nothing"

    class Axes(SimAxes):
        def home(self, axis: int, timeout_s: float) -> None:
            super().home(axis, timeout_s)
            with self._world.lock:
                self._motion.move(axis, 0.01, Profile(0.2, 4.0, 4.0))
                self._world.at(
                    self._world.tick + 150,
                    lambda: self._motion.move(axis, 0.0, Profile(0.2, 4.0, 4.0)),
                )


class HomingReturnsEarly(Mutant):
    breaks = ("AxisDriver.home/waits", "late")
    found_by = "test_scaling.py::test_homing_again_makes_the_new_position_zero"

    class Axes(SimAxes):
        def home(self, axis: int, timeout_s: float) -> None:
            with self._world.lock:
                self._world.advance()
                self._world.at(self._world.tick + 60, lambda: self._simulation.home(axis))


class HomeIsTenMilliradians(Mutant):
    breaks = ("AxisDriver.home/zero", "wrong value")
    found_by = "test_neighbours.py::test_the_home_position_of_one_axis"

    class Axes(SimAxes):
        def home(self, axis: int, timeout_s: float) -> None:
            super().home(axis, timeout_s)
            with self._world.lock:
                home = self._simulation.scaling.home.copy()
                home[axis] -= 0.003 * self._simulation.scaling.gain[axis]
                self._simulation._rescale(self._simulation.scaling.origin, home)


class PolarityToggles(Mutant):
    breaks = ("AxisDriver.set_polarity/sets", "second call")
    found_by = "test_scaling.py::test_polarity_is_set_and_not_toggled"

    class Axes(SimAxes):
        def set_polarity(self, axis: int, polarity: int) -> None:
            now = float(self._simulation.parameters["AxisPolarity"][axis])
            super().set_polarity(axis, int(-now) if polarity < 0 else 1)


class LastPolarityIgnored(Mutant):
    breaks = ("AxisDriver.set_polarity/sets", "last axis")
    found_by = "test_scaling.py::test_polarity_is_set_and_not_toggled"

    class Axes(SimAxes):
        def set_polarity(self, axis: int, polarity: int) -> None:
            if axis < self._simulation.axes - 1:
                super().set_polarity(axis, polarity)


class PolarityOfAnEnabledAxis(Mutant):
    breaks = ("AxisDriver.set_polarity/servo-off", "ignored")
    found_by = "test_scaling.py::test_the_scale_of_an_enabled_axis_is_not_changed"

    class Axes(SimAxes):
        def set_polarity(self, axis: int, polarity: int) -> None:
            with self._world.lock:
                self._simulation.change_scale(axis, {"AxisPolarity": polarity})


class DenominatorIgnored(Mutant):
    breaks = ("AxisDriver.set_gear_ratio/counts", "wrong value")
    found_by = "test_scaling.py::test_a_gear_ratio_is_a_fraction"

    class Axes(SimAxes):
        def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
            super().set_gear_ratio(axis, numerator, 6.283185307179586)


class GearRatioWorksOnce(Mutant):
    breaks = ("AxisDriver.set_gear_ratio/counts", "second call")
    found_by = "test_scaling.py::test_a_gear_ratio_is_a_fraction"

    class Axes(SimAxes):
        def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
            done = self.__dict__.setdefault("done", {})
            done[axis] = done.get(axis, 0) + 1
            if done[axis] < 3:
                super().set_gear_ratio(axis, numerator, denominator)


class LastGearRatioIgnored(Mutant):
    breaks = ("AxisDriver.set_gear_ratio/counts", "last axis")
    found_by = "test_scaling.py::test_a_gear_ratio_is_a_fraction"

    class Axes(SimAxes):
        def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
            if axis < self._simulation.axes - 1:
                super().set_gear_ratio(axis, numerator, denominator)


class GearRatioOfAnEnabledAxis(Mutant):
    breaks = ("AxisDriver.set_gear_ratio/servo-off", "ignored")
    found_by = "test_scaling.py::test_the_scale_of_an_enabled_axis_is_not_changed"

    class Axes(SimAxes):
        def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
            names = ("AxisGearRatioNumerator", "AxisGearRatioDenominator")
            with self._world.lock:
                values = dict(zip(names, (numerator, denominator), strict=True))
                self._simulation.change_scale(axis, values)
