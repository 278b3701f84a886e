"""Mutants: faults that sets of other authors had and no check found."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from threading import RLock

import numpy as np
from tests.features.conformance.runs.mutants.plugin import Mutant, ReadAnew

from robotd.api import (
    BusStatus,
    ConnectionState,
    DeviceTimeout,
    OperationError,
    ProcessImage,
    Profile,
)
from robotd_sim import (
    SimAxes,
    SimDevice,
    SimFieldbus,
)

SHORT_NS = 20_000_000


class RoundedDumps(Mutant):
    breaks = ("DeviceDriver.dump_parameters/text", "small")
    found_by = "test_parameters.py::test_each_load_is_in_force_also_after_communication_stopped"
    says = "rad/s² higher"

    class Device(SimDevice):
        def dump_parameters(self, axis: int) -> str:
            lines = (line.split(" = ") for line in super().dump_parameters(axis).splitlines())
            return "\n".join(f"{name} = {float(value):.3f}" for name, value in lines)


class NeverSaysThatItCanResume(Mutant):
    breaks = ("DeviceDriver.state/lost-link", "ignored")
    found_by = "test_reopening.py::test_a_lost_link_is_shown_and_resumed"
    says = "can be resumed"

    class Device(SimDevice):
        def start_communication(self, timeout_s: float) -> None:
            super().start_communication(timeout_s)
            self.__dict__["communicated"] = True

        def stop_communication(self, timeout_s: float) -> None:
            self.__dict__["communicated"] = False
            super().stop_communication(timeout_s)

        def state(self) -> ConnectionState:
            state, communicated = super().state(), self.__dict__.get("communicated", False)
            lost = communicated and state is ConnectionState.RUNNING
            return ConnectionState.UNKNOWN if lost else state


class ShortOutagesAreFresh(Mutant):
    """The last values are stamped anew while frames are missing for less than 20 ms."""

    breaks = ("AxisDriver.read/fresh", "stale")
    found_by = "test_ageing.py::test_a_short_silence_has_no_new_stamps"
    says = "but none came"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            now_ns = self._simulation.clock.now_ns()
            if not self._simulation.network.frozen:
                self.__dict__["arrived_ns"] = now_ns
            elif now_ns - self.__dict__.get("arrived_ns", 0) < SHORT_NS:
                image.fresh_ns = now_ns


class NearTheHomeIsHome(Mutant):
    breaks = ("AxisDriver.home/zero", "small")
    found_by = "test_scale_and_home.py::test_homing_makes_a_small_offset_zero_too"
    says = "mrad from the home before"

    class Axes(SimAxes):
        def home(self, axis: int, timeout_s: float) -> None:
            if self._states.home_done[axis] and abs(self._simulation.servo.position[axis]) < 0.01:
                return
            super().home(axis, timeout_s)


class HomeOfATurnedAxisDoubles(Mutant):
    breaks = ("AxisDriver.home/zero", "wrong value")
    found_by = "test_scale_and_home.py::test_homing_makes_a_small_offset_zero_too"
    says = "mrad from the home before"

    class Axes(SimAxes):
        def home(self, axis: int, timeout_s: float) -> None:
            simulation = self._simulation
            before = simulation.scaling.home.copy()
            super().home(axis, timeout_s)
            if simulation.parameters["AxisPolarity"][axis] < 0:
                home = simulation.scaling.home.copy()
                home[axis] = 2.0 * before[axis] - home[axis]
                with simulation.world.lock:
                    simulation._rescale(simulation.scaling.origin, home)


class AlarmResetsTheScale(Mutant):
    """Clearing an encoder's alarm starts the drive anew, with the parameters of its file."""

    breaks = ("AxisDriver.clear_alarm/clears", "side effect")
    found_by = "test_scale_and_home.py::test_a_scale_outlives_an_alarm_and_a_servo"
    says = "clearing alarm 0x7305"

    class Axes(SimAxes):
        def clear_alarm(self, axis: int, timeout_s: float) -> None:
            anew = self._states.alarm_code[axis] == 0x7305
            super().clear_alarm(axis, timeout_s)
            if anew:
                self.set_polarity(axis, 1)


class SpeedsByTheOldGear(Mutant):
    breaks = ("AxisDriver.move/profile", "wrong value")
    found_by = "test_scale_and_home.py::test_all_values_have_the_new_scale"
    says = "rad/s, commanded"

    class Axes(SimAxes):
        def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
            gains = self.__dict__.setdefault("gains", self._simulation.scaling.gain.copy())
            super().set_gear_ratio(axis, numerator, denominator)
            factor = gains[axis] / self._simulation.scaling.gain[axis]
            self.__dict__.setdefault("factors", {})[axis] = abs(float(factor))

        def move(self, axis: int, target: float, profile: Profile) -> None:
            factor = self.__dict__.get("factors", {}).get(axis, 1.0)
            ramps = profile.acceleration, profile.deceleration
            super().move(axis, target, Profile(factor * profile.velocity, *ramps))


class LostFramesInOneByte(Mutant):
    breaks = ("FieldbusDriver.status/status", "wrong value")
    found_by = "test_fieldbus.py::test_lost_frames_are_counted_beyond_a_byte"
    says = "frames are lost, after"

    class Fieldbus(SimFieldbus):
        def status(self, bus: int) -> BusStatus:
            status = super().status(bus)
            return replace(status, lost_frames=status.lost_frames & 0xFF)


class ObjectsOfFourBytes(Mutant):
    breaks = ("FieldbusDriver.read_object/value", "clipped")
    found_by = "test_bus_objects.py::test_names_of_nodes_are_read_to_their_end"
    says = "every name has 4 bytes"

    class Fieldbus(SimFieldbus):
        def read_object(self, bus: int, node: int, index: int, subindex: int) -> bytes:
            return super().read_object(bus, node, index, subindex)[:4]


class MovesShareABuffer(Mutant):
    """The target is written to one place, and taken from there a millisecond later."""

    breaks = ("drivers/threads", "wrong axis")
    found_by = "test_threads.py::test_moves_that_begin_at_once_keep_apart"
    says = "rad from its target"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            self.__dict__["target"] = target
            time.sleep(0.001)
            super().move(axis, self.__dict__["target"], profile)


class StateWaitsForTheStart(Mutant):
    breaks = ("DeviceDriver.state/blocks", "blocks")
    found_by = "test_locks.py::test_the_state_does_not_wait_for_a_start"
    says = "state waits"

    class Device(SimDevice):
        def _held(self) -> RLock:
            lock: RLock = self.__dict__.setdefault("held", RLock())
            return lock

        def start_communication(self, timeout_s: float) -> None:
            with self._held():
                time.sleep(0.05)
                super().start_communication(timeout_s)

        def state(self) -> ConnectionState:
            with self._held():
                return super().state()


class WholeNumbersOfTheGear(Mutant):
    breaks = ("AxisDriver.set_gear_ratio/counts", "small")
    found_by = "test_scaling.py::test_a_gear_ratio_is_a_fraction"

    class Axes(SimAxes):
        def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
            whole = float(max(1, int(numerator))), float(max(1, int(denominator)))
            super().set_gear_ratio(axis, *whole)


class TimeOutsOfTheLibrary(Mutant):
    breaks = ("drivers/errors", "raises")
    found_by = "test_enable.py::test_what_takes_too_long_is_a_time_out"
    says = "error 11"

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            try:
                super().servo(axis, on, timeout_s)
            except DeviceTimeout:
                raise RuntimeError("error 11") from None


class AbortsWithoutTheirCode(Mutant):
    breaks = ("FieldbusDriver.read_object/errors", "clipped")
    found_by = (
        "test_fieldbus.py::test_an_object_that_the_node_does_not_have_is_an_error_without_effect"
    )
    says = "transfer failed"

    class Fieldbus(SimFieldbus):
        def read_object(self, bus: int, node: int, index: int, subindex: int) -> bytes:
            try:
                return super().read_object(bus, node, index, subindex)
            except OperationError:
                raise OperationError("transfer failed") from None


class StopsFromTheFirstToTheLast(Mutant):
    """Of a range, though only its ends were named."""

    breaks = ("AxisDriver.stop/all-axes", "wrong axis")
    found_by = "test_stops_of_some_axes.py::test_a_stop_reaches_each_named_axis_of_a_move"
    says = "stopped another axis"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            super().stop(range(min(axes), max(axes) + 1))


class TorqueEndsAtItsRatedOne(Mutant):
    breaks = ("AxisDriver.read/torque", "clipped")
    found_by = "test_feedback.py::test_torque_is_in_newton_metres"
    says = "shown for 1 N·m"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            np.clip(image.torque, -4.0, 4.0, out=image.torque)


class StampsLateByThePause(Mutant):
    breaks = ("AxisDriver.read/fresh", "stale")
    found_by = "test_ageing.py::test_a_pause_of_communication_makes_no_value_older"
    says = "before they are shown"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            now_ns = self._simulation.clock.now_ns()
            gap_ns = now_ns - self.__dict__.get("heard_ns", now_ns)
            if self._simulation.communicating:
                self.__dict__["heard_ns"] = now_ns
            if gap_ns > SHORT_NS:
                self.__dict__["late_ns"] = gap_ns
            image.fresh_ns -= self.__dict__.get("late_ns", 0)
