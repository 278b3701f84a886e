"""Mutants: Units, signs and ranges of positions."""

from __future__ import annotations

from functools import partial

import numpy as np
from tests.features.conformance.runs.mutants.plugin import Mutant, ReadAnew

from robotd.api import (
    FloatArray,
    ProcessImage,
    Profile,
)
from robotd_sim import SimAxes

DEGREES = 180.0 / np.pi


class SignFlipped(Mutant):
    breaks = ("drivers/units", "wrong value")
    found_by = "test_units.py::test_a_commanded_radian_is_a_measured_radian"
    says = "position"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, -target, profile)


class MirroredThroughout(Mutant):
    """Commands and measured values agree, but the shaft turns the other way."""

    breaks = ("AxisDriver.read/measured", "one direction")
    found_by = "test_units.py::test_the_measured_position_is_that_of_the_shaft"
    says = "axes differ"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            for values in (
                image.position,
                image.velocity,
                image.position_command,
                image.velocity_command,
            ):
                np.negative(values, values)

        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, -target, profile)


class Degrees(Mutant):
    breaks = ("AxisDriver.move/target", "wrong value")
    found_by = "test_units.py::test_a_commanded_radian_is_a_measured_radian"
    says = "position|at rest"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target * DEGREES, profile)


class StreamedDegrees(Mutant):
    breaks = ("AxisDriver.stream/position", "wrong value")
    found_by = "test_units.py::test_a_streamed_radian_is_a_measured_radian"
    says = "position"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            super().stream(position / DEGREES, velocity / DEGREES, due_ns)


class TurnsPerMinute(Mutant):
    breaks = ("AxisDriver.read/measured", "wrong value")
    found_by = "test_units.py::test_the_velocity_is_the_slope_of_the_position"
    says = "measured"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.velocity *= 60.0 / (2.0 * np.pi)


class AxesSwapped(Mutant):
    breaks = ("AxisDriver.move/starts", "wrong axis")
    found_by = "test_units.py::test_each_axis_moves_alone"
    says = "position"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move({0: 1, 1: 0}.get(axis, axis), target, profile)


class JogsBackwards(Mutant):
    breaks = ("AxisDriver.jog/starts", "one direction")
    found_by = "test_units.py::test_a_positive_velocity_raises_the_position"
    says = "velocity"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            back = Profile(-profile.velocity, profile.acceleration, profile.deceleration)
            super().jog(axis, back)


class ShortMovesIgnored(Mutant):
    breaks = ("AxisDriver.move/starts", "small")
    found_by = "test_ramps.py::test_a_short_move_is_made"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            if abs(target - float(self._simulation.servo.command[axis])) > 0.02:
                super().move(axis, target, profile)


class WrapsTargets(Mutant):
    breaks = ("AxisDriver.move/target", "wrong value")
    found_by = "test_ramps.py::test_a_radian_is_a_radian_far_from_zero_and_beyond_a_turn"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, (target + np.pi) % (2 * np.pi) - np.pi, profile)


class WrapsPositions(Mutant):
    breaks = ("AxisDriver.read/measured", "wrong value")
    found_by = "test_ramps.py::test_a_radian_is_a_radian_far_from_zero_and_beyond_a_turn"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.position[:] = (image.position + np.pi) % (2 * np.pi) - np.pi


class SmallGain(Mutant):
    breaks = ("AxisDriver.move/target", "wrong value")
    found_by = "test_ramps.py::test_a_radian_is_a_radian_far_from_zero_and_beyond_a_turn"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.position[:] = 1.003 * np.asarray(
                self._simulation.scaling.quantised(self._simulation.servo.position.tolist())
            )


class Drifts(Mutant):
    """1 mrad/s while an axis is at rest with its servo on."""

    breaks = ("AxisDriver.stop/rests", "side effect")
    found_by = "test_ramps.py::test_a_standing_axis_does_not_drift"

    class Axes(SimAxes):
        step_rad = 2e-6  # for each read

        def read(self, image: ProcessImage) -> None:
            with self._world.lock:
                self._world.advance()
                for axis in np.flatnonzero(self._states.servo_on):
                    if self._motion.is_idle(int(axis)):
                        servo = self._simulation.servo
                        here = float(servo.command[axis]) + self.step_rad
                        servo.place(int(axis), here, here, 0.0)
            super().read(image)
            image.position[:] = self._simulation.servo.position


class ClampsAtHalfATurn(Mutant):
    breaks = ("AxisDriver.move/target", "clipped")
    found_by = "test_ramps.py::test_a_radian_is_a_radian_far_from_zero_and_beyond_a_turn"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, float(np.clip(target, -np.pi, np.pi)), profile)


class GainFarFromZero(Mutant):
    breaks = ("AxisDriver.move/target", "wrong value")
    found_by = "test_ramps.py::test_a_radian_is_a_radian_far_from_zero_and_beyond_a_turn"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            far = np.abs(image.position) > 2.0
            image.position[far] *= 1.004


class SmallOffset(Mutant):
    breaks = ("AxisDriver.move/target", "wrong value")
    found_by = "test_ramps.py::test_a_short_move_is_made"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.position += 0.004


class DriftsSlowly(Mutant):
    """0.3 mrad/s while an axis is at rest with its servo on."""

    breaks = ("AxisDriver.stop/rests", "side effect")
    found_by = "test_ramps.py::test_a_standing_axis_does_not_drift"

    class Axes(Drifts.Axes):
        step_rad = 0.6e-6


class SagsAfterAMove(Mutant):
    """4 mrad down within a second after each move."""

    breaks = ("AxisDriver.move/target", "wrong value")
    found_by = "test_ramps.py::test_a_standing_axis_does_not_drift"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, profile)
            sag = partial(self._sag, axis, target)
            self._world.at(self._world.tick + 1500, sag)

        def _sag(self, axis: int, target: float) -> None:
            here = float(self._simulation.servo.command[axis])
            if self._motion.is_idle(axis) and abs(here - target) < 1e-3:
                self._motion.move(axis, target - 0.004, Profile(0.01, 1.0, 1.0))


class VelocityHalved(Mutant):
    breaks = ("AxisDriver.stream/velocity", "clipped")
    found_by = "test_units.py::test_a_streamed_radian_is_a_measured_radian"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            super().stream(position, velocity / 2, due_ns)
