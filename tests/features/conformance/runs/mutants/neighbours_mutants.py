"""Mutants: Commands to one axis that change another."""

from __future__ import annotations

import numpy as np
from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import (
    CommandMode,
    ProcessImage,
)
from robotd_sim import SimAxes


class ModeOfAll(Mutant):
    breaks = ("AxisDriver.set_command_mode/changes", "wrong axis")
    found_by = "test_neighbours.py::test_the_mode_of_one_axis"

    class Axes(SimAxes):
        def set_command_mode(self, axis: int, mode: CommandMode) -> None:
            for other in range(self._simulation.axes):
                super().set_command_mode(other, mode)


class PolarityOfAll(Mutant):
    breaks = ("AxisDriver.set_polarity/sets", "wrong axis")
    found_by = "test_neighbours.py::test_the_polarity_of_one_axis"

    class Axes(SimAxes):
        def set_polarity(self, axis: int, polarity: int) -> None:
            for other in range(self._simulation.axes):
                super().set_polarity(other, polarity)


class GearOfAll(Mutant):
    breaks = ("AxisDriver.set_gear_ratio/counts", "wrong axis")
    found_by = "test_neighbours.py::test_the_gear_ratio_of_one_axis"

    class Axes(SimAxes):
        def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
            for other in range(self._simulation.axes):
                super().set_gear_ratio(other, numerator, denominator)


class HomeOfAll(Mutant):
    breaks = ("AxisDriver.home/zero", "wrong axis")
    found_by = "test_neighbours.py::test_the_home_position_of_one_axis"

    class Axes(SimAxes):
        def home(self, axis: int, timeout_s: float) -> None:
            for other in range(self._simulation.axes):
                super().home(other, timeout_s)


class HomeDoneFromTheStart(Mutant):
    breaks = ("AxisDriver.read/states", "wrong value")
    found_by = "test_neighbours.py::test_the_home_position_of_one_axis"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.home_done[:] = True


class PolarityOfTheNext(Mutant):
    breaks = ("AxisDriver.set_polarity/sets", "wrong axis")
    found_by = "test_neighbours.py::test_the_polarity_of_one_axis"

    class Axes(SimAxes):
        def set_polarity(self, axis: int, polarity: int) -> None:
            super().set_polarity(axis, polarity)
            super().set_polarity((axis + 1) % self._simulation.axes, polarity)


class GearResetsTheNext(Mutant):
    breaks = ("AxisDriver.set_gear_ratio/counts", "wrong axis")
    found_by = "test_neighbours.py::test_the_gear_ratio_of_one_axis"

    class Axes(SimAxes):
        def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
            super().set_gear_ratio(axis, numerator, denominator)
            following = (axis + 1) % self._simulation.axes
            super().set_gear_ratio(following, 2.0**20, 2 * np.pi)


class ModeOfTheNext(Mutant):
    breaks = ("AxisDriver.set_command_mode/changes", "wrong axis")
    found_by = "test_neighbours.py::test_the_mode_of_one_axis"

    class Axes(SimAxes):
        def set_command_mode(self, axis: int, mode: CommandMode) -> None:
            super().set_command_mode(axis, mode)
            super().set_command_mode((axis + 1) % self._simulation.axes, mode)


class HomingForgetsOthers(Mutant):
    breaks = ("AxisDriver.home/zero", "wrong axis")
    found_by = "test_neighbours.py::test_the_home_position_of_one_axis"

    class Axes(SimAxes):
        def home(self, axis: int, timeout_s: float) -> None:
            super().home(axis, timeout_s)
            self._states.home_done[:axis] = False


class ClearingSwitchesOthersOff(Mutant):
    breaks = ("AxisDriver.clear_alarm/idle", "side effect")
    found_by = "test_faults.py::test_clearing_without_an_alarm_has_no_effect"

    class Axes(SimAxes):
        def clear_alarm(self, axis: int, timeout_s: float) -> None:
            super().clear_alarm(axis, timeout_s)
            with self._world.lock:
                for other in range(self._simulation.axes):
                    if other != axis:
                        self._simulation.power.turn_off(other)
