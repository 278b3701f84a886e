"""Mutants: Measured values, their time stamps and switches."""

from __future__ import annotations

import time

import numpy as np
from tests.features.conformance.runs.mutants.plugin import Mutant, ReadAnew

from robotd.api import (
    Operation,
    ProcessImage,
    Profile,
)
from robotd_sim import SimAxes, SimDevice, SimFaultInjector


class StaleValues(Mutant):
    """New positions come three times a second."""

    breaks = ("AxisDriver.read/measured", "stale")
    found_by = "test_ageing.py::test_values_follow_the_motion"
    says = "stale_s"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            kept, since_ns = self.__dict__.get("kept", (None, 0))
            if kept is None or image.fresh_ns - since_ns > 300_000_000:
                self.__dict__["kept"] = (image.position.copy(), image.fresh_ns)
            else:
                image.position[:] = kept


class AlwaysFresh(Mutant):
    breaks = ("AxisDriver.read/fresh", "wrong value")
    found_by = "test_ageing.py::test_a_dead_bus_does_not_look_alive"
    says = "not ready"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.fresh_ns = self._simulation.clock.now_ns()


class AnotherClock(Mutant):
    breaks = ("AxisDriver.read/fresh", "wrong value")
    found_by = "test_ageing.py::test_values_are_fresh"
    says = "another clock|ready|stale"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.fresh_ns = time.monotonic_ns()


class StampsGoBack(Mutant):
    breaks = ("AxisDriver.read/fresh", "wrong value")
    found_by = "test_feedback.py::test_time_stamps_never_go_back"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            count = self.__dict__["count"] = int(self.__dict__.get("count", 0)) + 1
            if count % 40 == 0:
                image.fresh_ns -= 5_000_000


class MeasuresItsCommand(Mutant):
    breaks = ("AxisDriver.read/measured", "wrong value")
    found_by = "test_feedback.py::test_a_blocked_axis_is_measured_where_it_is"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.position[:] = image.position_command


class MeasuresItsCommandedVelocity(Mutant):
    breaks = ("AxisDriver.read/measured", "wrong value")
    found_by = "test_feedback.py::test_a_blocked_axis_is_measured_where_it_is"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.velocity[:] = image.velocity_command


class CommandsItsMeasurement(Mutant):
    breaks = ("AxisDriver.read/commands", "wrong value")
    found_by = "test_feedback.py::test_a_blocked_axis_is_measured_where_it_is"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.position_command[:] = image.position


class TorqueBackwards(Mutant):
    breaks = ("AxisDriver.read/torque", "wrong value")
    found_by = "test_feedback.py::test_torque_pushes_the_way_the_axis_accelerates_or_is_not_known"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.torque[:] = -image.torque


class TorqueZero(Mutant):
    breaks = ("AxisDriver.read/nan", "wrong value")
    found_by = "test_feedback.py::test_torque_pushes_the_way_the_axis_accelerates_or_is_not_known"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.torque[:] = 0.0


class InjectorEchoes(Mutant):
    breaks = ("FaultInjector.position/shaft", "wrong value")
    found_by = "test_feedback.py::test_a_blocked_axis_is_measured_where_it_is"

    class Injector(SimFaultInjector):
        def position(self, axis: int) -> float:
            return float(self._simulation.servo.command[axis])


class StampsInTheFuture(Mutant):
    breaks = ("AxisDriver.read/fresh", "wrong value")
    found_by = "test_ageing.py::test_values_are_fresh"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.fresh_ns = self._simulation.world.now_ns + 30_000_000


class CoarseStamps(Mutant):
    breaks = ("AxisDriver.read/fresh", "stale")
    found_by = "test_ageing.py::test_values_are_fresh"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.fresh_ns = image.fresh_ns // 200_000_000 * 200_000_000


class LimitsSwapped(Mutant):
    breaks = ("AxisDriver.read/switches", "wrong value")
    found_by = "test_switches.py::test_a_closed_switch_is_shown_alone_until_it_is_released"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            both = image.negative_limit.copy(), image.positive_limit.copy()
            image.positive_limit[:], image.negative_limit[:] = both


class LimitsLatched(Mutant):
    breaks = ("AxisDriver.read/switches", "stale")
    found_by = "test_switches.py::test_a_closed_switch_is_shown_alone_until_it_is_released"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            seen = self.__dict__.setdefault("seen", np.zeros(image.axes, bool))
            seen |= image.negative_limit
            image.negative_limit[:] = seen


class LimitsOfAll(Mutant):
    breaks = ("AxisDriver.read/switches", "wrong axis")
    found_by = "test_switches.py::test_a_closed_switch_is_shown_alone_until_it_is_released"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.positive_limit[:] = image.positive_limit.any()


class HomeSwitchNeverShown(Mutant):
    breaks = ("AxisDriver.read/switches", "ignored")
    found_by = "test_switches.py::test_a_closed_switch_is_shown_alone_until_it_is_released"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.home_switch[:] = False


class HomeSwitchIsHomeDone(Mutant):
    breaks = ("AxisDriver.read/states", "wrong value")
    found_by = "test_switches.py::test_a_switch_moves_no_axis_and_defines_no_home"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.home_done |= image.home_switch


class SwitchesInverted(Mutant):
    breaks = ("AxisDriver.read/switches", "wrong value")
    found_by = "test_switches.py::test_a_closed_switch_is_shown_alone_until_it_is_released"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            np.logical_not(image.negative_limit, image.negative_limit)


class SwitchesByEdge(Mutant):
    """A switch that is closed when communication starts is not seen."""

    breaks = ("AxisDriver.read/switches", "ignored")
    found_by = "test_switches.py::test_a_switch_that_is_closed_at_the_start_is_shown"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            if self._simulation.__dict__.get("ignored") == self._simulation.switches.changes:
                image.negative_limit[:] = False

    class Device(SimDevice):
        def start_communication(self, timeout_s: float) -> None:
            self.simulation.__dict__["ignored"] = self.simulation.switches.changes
            super().start_communication(timeout_s)


class TorqueInPercent(Mutant):
    breaks = ("AxisDriver.read/torque", "wrong value")
    found_by = "test_feedback.py::test_torque_is_in_newton_metres"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.torque *= 100.0 / 20.0


class TorqueInKilopondMetres(Mutant):
    breaks = ("AxisDriver.read/torque", "wrong value")
    found_by = "test_feedback.py::test_torque_is_in_newton_metres"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.torque /= 9.81


class TorqueInfinite(Mutant):
    breaks = ("AxisDriver.read/torque", "wrong value")
    found_by = "test_units.py::test_torque_is_finite_or_not_known"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.torque[:] = np.inf


class CommandIsTheTarget(Mutant):
    breaks = ("AxisDriver.read/commands", "wrong value")
    found_by = "test_units.py::test_the_commands_in_the_image_are_those_that_were_given"

    class Axes(ReadAnew):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, profile)
            self.__dict__.setdefault("targets", {})[axis] = target

        def read(self, image: ProcessImage) -> None:
            super().read(image)
            for axis, target in self.__dict__.get("targets", {}).items():
                if image.operation[axis] == Operation.POSITION:
                    image.position_command[axis] = target


class CommandedVelocityMissing(Mutant):
    breaks = ("AxisDriver.read/commands", "ignored")
    found_by = "test_ageing.py::test_values_follow_the_motion"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.velocity_command[:] = 0.0


class AlwaysComplete(Mutant):
    breaks = ("AxisDriver.read/complete", "wrong value")
    found_by = "test_profiles.py::test_a_move_shows_what_it_does"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.motion_complete[:] = True


class NeverComplete(Mutant):
    breaks = ("AxisDriver.read/complete", "wrong value")
    found_by = "test_profiles.py::test_a_move_shows_what_it_does"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.motion_complete[:] = False


class VelocityLags(Mutant):
    breaks = ("AxisDriver.read/measured", "stale")
    found_by = "test_units.py::test_the_velocity_is_the_slope_of_the_position"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            slow = self.__dict__.setdefault("slow", np.zeros(image.axes))
            slow += 0.02 * (image.velocity - slow)
            image.velocity[:] = slow


class InjectorBlocksNothing(Mutant):
    breaks = ("FaultInjector.block/held", "ignored")
    found_by = "test_feedback.py::test_a_blocked_axis_is_measured_where_it_is"

    class Injector(SimFaultInjector):
        def block(self, axis: int, blocked: bool) -> None:
            pass
