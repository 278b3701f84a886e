"""Mutants: polarity, gear ratio, home and parameter files that disturb each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from tests.features.conformance.runs.mutants.plugin import Mutant, ReadAnew

from robotd.api import DescriptorError, FloatArray, NotReady, ProcessImage, Profile
from robotd_sim import SimAxes, SimDevice
from robotd_wmx_parameters import read_wmx_parameters

TOGETHER = "test_scale_and_home.py::test_polarity_and_gear_ratio_leave_each_other_alone"


class PolarityResetsTheGear(Mutant):
    breaks = ("AxisDriver.set_polarity/ratio", "side effect")
    found_by = TOGETHER
    says = "polarity -?1 of axis"

    class Axes(SimAxes):
        def set_polarity(self, axis: int, polarity: int) -> None:
            self.set_gear_ratio(axis, 2.0**18, 2.0 * np.pi)
            super().set_polarity(axis, polarity)


class SameGearTurnsTheAxis(Mutant):
    """A ratio that is in force already is set without its sign."""

    breaks = ("AxisDriver.set_gear_ratio/polarity", "side effect")
    found_by = TOGETHER
    says = "gear ratio of axis"

    class Axes(SimAxes):
        def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
            known = self.__dict__.setdefault("ratios", {})
            again = known.get(axis) == (numerator, denominator)
            known[axis] = numerator, denominator
            super().set_gear_ratio(axis, numerator, denominator)
            if again:
                super().set_polarity(axis, 1)


class CommandedVelocityByTheOldGear(Mutant):
    breaks = ("AxisDriver.set_gear_ratio/counts", "wrong value")
    found_by = "test_scale_and_home.py::test_all_values_have_the_new_scale"
    says = "velocity_command"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            for axis, factor in self.__dict__.get("factors", {}).items():
                image.velocity_command[axis] *= factor

        def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
            scaling = self._simulation.scaling
            first = self.__dict__.setdefault("first", scaling.gain.copy())
            super().set_gear_ratio(axis, numerator, denominator)
            self.__dict__.setdefault("factors", {})[axis] = abs(scaling.gain[axis] / first[axis])


class ScaleStopsTheOthers(Mutant):
    breaks = ("AxisDriver.set_polarity/sets", "wrong axis")
    found_by = "test_scale_and_home.py::test_a_scale_is_changed_beside_axes_in_motion"
    says = "from its target"

    class Axes(SimAxes):
        def set_polarity(self, axis: int, polarity: int) -> None:
            super().set_polarity(axis, polarity)
            self.stop(range(self._simulation.axes))


class HomingTakesTheServoOn(Mutant):
    breaks = ("AxisDriver.home/servo-off", "side effect")
    found_by = "test_scale_and_home.py::test_homing_with_the_servo_off_is_done_or_rejected"
    says = "switched a servo on"

    class Axes(SimAxes):
        def home(self, axis: int, timeout_s: float) -> None:
            self.servo(axis, True, timeout_s)
            super().home(axis, timeout_s)


class HomingOffSetsTheFlagOnly(Mutant):
    breaks = ("AxisDriver.home/servo-off", "ignored")
    found_by = "test_scale_and_home.py::test_homing_with_the_servo_off_is_done_or_rejected"
    says = "with its servo off: axis"

    class Axes(SimAxes):
        def home(self, axis: int, timeout_s: float) -> None:
            home = self._simulation.scaling.home.copy()
            super().home(axis, timeout_s)
            if not self._states.servo_on[axis]:
                self._simulation._rescale(self._simulation.scaling.origin, home)


class CommandKeepsItsOldNumber(Mutant):
    """Until the next motion, of each axis but the first."""

    breaks = ("AxisDriver.home/command", "stale")
    found_by = "test_scale_and_home.py::test_the_command_is_zero_after_homing_too"
    says = "the command of axis"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            for axis, command in self.__dict__.get("kept", {}).items():
                image.position_command[axis] = command

        def home(self, axis: int, timeout_s: float) -> None:
            if axis:
                command = float(self._simulation.servo.command[axis])
                self.__dict__.setdefault("kept", {})[axis] = command
            super().home(axis, timeout_s)


class TurnsAboutTheZeroOfTheEncoder(Mutant):
    breaks = ("AxisDriver.set_polarity/ratio", "side effect")
    found_by = "test_scale_and_home.py::test_a_scale_turns_about_the_home_position"
    says = "the last axis is at"

    class Axes(SimAxes):
        def set_polarity(self, axis: int, polarity: int) -> None:
            super().set_polarity(axis, polarity)
            simulation = self._simulation
            with simulation.world.lock:
                home = simulation.scaling.home.copy()
                home[axis] = 0.0
                simulation._rescale(simulation.scaling.origin, home)


class DumpWithTheGearOfTheFile(Mutant):
    breaks = ("DeviceDriver.dump_parameters/scale", "stale")
    found_by = "test_parameters.py::test_a_dump_shows_what_is_changed_at_run_time"
    says = "gear ratio of axis"

    class Device(SimDevice):
        def dump_parameters(self, axis: int) -> str:
            lines = super().dump_parameters(axis).splitlines()
            return "\n".join(line for line in lines if "GearRatio" not in line)


class StartAppliesTheDefaults(Mutant):
    breaks = ("DeviceDriver.load_parameters/kept", "ignored")
    found_by = "test_parameters.py::test_each_load_is_in_force_also_after_communication_stopped"
    says = "communication that was stopped and started"

    class Device(SimDevice):
        def start_communication(self, timeout_s: float) -> None:
            with self.simulation.world.lock:
                self.simulation.world.advance()
                self.simulation.apply(self.simulation._defaults)
            super().start_communication(timeout_s)


class AFileIsLoadedOnce(Mutant):
    breaks = ("DeviceDriver.load_parameters/applies", "second call")
    found_by = "test_parameters.py::test_each_load_is_in_force_also_after_communication_stopped"
    says = "the first file again"

    class Device(SimDevice):
        def load_parameters(self, path: Path) -> str:
            known = self.__dict__.setdefault("known", set())
            if path in known:
                return ""
            known.add(path)
            return super().load_parameters(path)


class RejectedFileLeavesItsRamps(Mutant):
    breaks = ("DeviceDriver.load_parameters/applies", "side effect")
    found_by = "test_parameters.py::test_a_load_that_one_axis_forbids_changes_no_other"
    says = "a file rejected for axis"

    class Device(SimDevice):
        def load_parameters(self, path: Path) -> str:
            try:
                return super().load_parameters(path)
            except NotReady:
                self._take(read_wmx_parameters(path, self.simulation.axes)["QuickStopDec"])
                raise

        def _take(self, ramps: np.ndarray) -> None:
            simulation = self.simulation
            changes: Mapping[int, float] = dict(enumerate(ramps[: simulation.axes].tolist()))
            simulation.parameters = simulation.parameters.with_values({"QuickStopDec": changes})


class RejectionNamesNoAxis(Mutant):
    breaks = ("DeviceDriver.load_parameters/named", "wrong value")
    found_by = "test_parameters.py::test_a_load_that_one_axis_forbids_changes_no_other"
    says = "did not match|does not match"

    class Device(SimDevice):
        def load_parameters(self, path: Path) -> str:
            try:
                return super().load_parameters(path)
            except NotReady as error:
                raise NotReady("a servo is on") from error


class WrongValuesAreLeftOut(Mutant):
    breaks = ("DeviceDriver.load_parameters/wrong-file", "ignored")
    found_by = "test_parameters.py::test_a_wrong_value_of_the_last_axis_changes_no_axis"
    says = "DID NOT RAISE"

    class Device(SimDevice):
        def load_parameters(self, path: Path) -> str:
            try:
                return super().load_parameters(path)
            except DescriptorError:
                return "some values were left out"


class ScaleLostAtTheStart(Mutant):
    breaks = ("DeviceDriver.dump_parameters/scale", "stale")
    found_by = "test_parameters.py::test_each_load_is_in_force_also_after_communication_stopped"
    says = "communication that was stopped and started"

    class Device(SimDevice):
        def start_communication(self, timeout_s: float) -> None:
            simulation = self.simulation
            plain = dict.fromkeys(range(simulation.axes), 1)
            with simulation.world.lock:
                simulation.parameters = simulation.parameters.with_values({"AxisPolarity": plain})
            super().start_communication(timeout_s)


class NotesSayNothing(Mutant):
    breaks = ("DeviceDriver.load_parameters/note", "wrong value")
    found_by = "test_parameters.py::test_a_note_says_what_a_file_leaves_out"
    says = "the note is"

    class Device(SimDevice):
        def load_parameters(self, path: Path) -> str:
            super().load_parameters(path)
            return ""


class HomingTurnsTheAxisBack(Mutant):
    breaks = ("AxisDriver.home/scale", "side effect")
    found_by = "test_scale_and_home.py::test_homing_leaves_the_scale_alone"
    says = "the polarity as before homing"

    class Axes(SimAxes):
        def home(self, axis: int, timeout_s: float) -> None:
            super().home(axis, timeout_s)
            with self._world.lock:
                self._world.advance()
                self._simulation.change_scale(axis, {"AxisPolarity": 1})


class JogsWithoutPolarity(Mutant):
    breaks = ("AxisDriver.set_polarity/sets", "ignored")
    found_by = "test_scale_and_home.py::test_every_kind_of_command_has_the_new_scale"
    says = "rad/s are"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            sign = float(self._simulation.parameters["AxisPolarity"][axis])
            super().jog(axis, replace(profile, velocity=sign * profile.velocity))


class StreamsByTheOldGear(Mutant):
    breaks = ("AxisDriver.set_gear_ratio/counts", "ignored")
    found_by = "test_scale_and_home.py::test_every_kind_of_command_has_the_new_scale"
    says = "a stream to|at rest"

    class Axes(SimAxes):
        def begin_stream(self, axes: Sequence[int]) -> None:
            super().begin_stream(axes)
            self.__dict__["begin"] = np.array(self._simulation.servo.command)

        def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
            scaling = self._simulation.scaling
            first = self.__dict__.setdefault("first", np.abs(scaling.gain))
            super().set_gear_ratio(axis, numerator, denominator)
            self.__dict__["factor"] = first / np.abs(scaling.gain)

        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            begin = self.__dict__["begin"]
            factor = self.__dict__.get("factor", 1.0)
            super().stream(begin + (position - begin) * factor, velocity * factor, due_ns)
