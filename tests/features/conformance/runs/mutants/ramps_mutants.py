"""Mutants: Velocities and ramps of moves and velocity commands."""

from __future__ import annotations

from functools import partial

from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import (
    Operation,
    Profile,
)
from robotd_sim import SimAxes


class TooFast(Mutant):
    breaks = ("AxisDriver.move/profile", "wrong value")
    found_by = (
        "test_profiles.py::test_a_move_keeps_to_its_velocity",
        "test_profiles.py::test_a_second_is_a_second",
    )

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            fast = Profile(1.5 * profile.velocity, profile.acceleration, profile.deceleration)
            super().move(axis, target, fast)


class TooSteep(Mutant):
    breaks = ("AxisDriver.move/profile", "wrong value")
    found_by = "test_profiles.py::test_a_move_keeps_to_its_ramps"
    says = "acceleration"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            steep = Profile(profile.velocity, 2 * profile.acceleration, 2 * profile.deceleration)
            super().move(axis, target, steep)


class JumpsToNewTargets(Mutant):
    breaks = ("AxisDriver.move/overrides", "wrong value")
    found_by = "test_profiles.py::test_a_new_target_is_taken_without_a_jump"
    says = "acceleration"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            with self._world.lock:
                self._world.advance()
                here = float(self._simulation.servo.command[axis])
                self._simulation.servo.place(axis, here, here, 0.0)
            super().move(axis, target, profile)


class SwappedRamps(Mutant):
    breaks = ("AxisDriver.move/profile", "wrong value")
    found_by = "test_ramps.py::test_a_move_has_the_ramps_of_its_profile"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            swapped = Profile(profile.velocity, profile.deceleration, profile.acceleration)
            super().move(axis, target, swapped)


class SwappedRampsOfJog(Mutant):
    breaks = ("AxisDriver.jog/profile", "wrong value")
    found_by = "test_ramps.py::test_a_velocity_command_has_the_ramps_of_its_profile"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            swapped = Profile(profile.velocity, profile.deceleration, profile.acceleration)
            super().jog(axis, swapped)


class FixedAcceleration(Mutant):
    breaks = ("AxisDriver.move/profile", "clipped")
    found_by = "test_ramps.py::test_a_move_has_the_ramps_of_its_profile"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, Profile(profile.velocity, 4.0, profile.deceleration))


class FixedDeceleration(Mutant):
    breaks = ("AxisDriver.move/profile", "clipped")
    found_by = "test_ramps.py::test_a_move_has_the_ramps_of_its_profile"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, Profile(profile.velocity, profile.acceleration, 4.0))


class FixedVelocity(Mutant):
    breaks = ("AxisDriver.move/profile", "clipped")
    found_by = "test_profiles.py::test_a_move_keeps_to_its_velocity"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, Profile(0.8, profile.acceleration, profile.deceleration))


class GentleRamps(Mutant):
    breaks = ("AxisDriver.move/profile", "clipped")
    found_by = "test_ramps.py::test_a_move_has_the_ramps_of_its_profile"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            ramps = 0.4 * profile.acceleration, 0.4 * profile.deceleration
            super().move(axis, target, Profile(profile.velocity, *ramps))


class Overshoots(Mutant):
    breaks = ("AxisDriver.move/target", "wrong value")
    found_by = "test_profiles.py::test_a_move_ends_at_its_target_without_overshoot"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            start = float(self._simulation.servo.command[axis])
            super().move(axis, target + 0.03 * (target - start), profile)
            back = partial(self._motion.move, axis, target, Profile(0.3, 4.0, 4.0))
            self._world.at(self._world.tick + 1200, back)


class GentleRampsOfJog(Mutant):
    breaks = ("AxisDriver.jog/profile", "clipped")
    found_by = "test_ramps.py::test_a_velocity_command_has_the_ramps_of_its_profile"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            ramps = 0.5 * profile.acceleration, 0.5 * profile.deceleration
            super().jog(axis, Profile(profile.velocity, *ramps))


class JogsFaster(Mutant):
    breaks = ("AxisDriver.jog/starts", "wrong value")
    found_by = "test_units.py::test_a_positive_velocity_raises_the_position"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            fast = Profile(1.2 * profile.velocity, profile.acceleration, profile.deceleration)
            super().jog(axis, fast)


class StopsShortOfItsTarget(Mutant):
    breaks = ("AxisDriver.move/target", "clipped")
    found_by = "test_ramps.py::test_a_radian_is_a_radian_far_from_zero_and_beyond_a_turn"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            start = float(self._simulation.servo.command[axis])
            super().move(axis, target - 0.01 * (target - start), profile)


class KeepsTheFirstTarget(Mutant):
    """A move is not overridden by the next."""

    breaks = ("AxisDriver.move/overrides", "ignored")
    found_by = "test_profiles.py::test_a_new_target_is_taken_without_a_jump"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            if self._states.operation[axis] == Operation.IDLE:
                super().move(axis, target, profile)


class RelativeTargets(Mutant):
    breaks = ("AxisDriver.move/target", "wrong value")
    found_by = "test_units.py::test_a_commanded_radian_is_a_measured_radian"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            start = float(self._simulation.servo.command[axis])
            super().move(axis, start + target, profile)
