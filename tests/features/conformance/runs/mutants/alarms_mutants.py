"""Mutants: Alarms, their codes and reasons."""

from __future__ import annotations

import time
from functools import partial

import numpy as np
from tests.features.conformance.runs.mutants.plugin import Mutant, ReadAnew

from robotd.api import (
    ProcessImage,
)
from robotd_sim import SimAxes, SimDevice, SimFaultInjector


class SwallowedFault(Mutant):
    breaks = ("AxisDriver.read/alarms", "ignored")
    found_by = "test_faults.py::test_an_alarm_is_shown_with_its_code"
    says = "the alarm is shown"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.amp_alarm[:] = False
            image.alarm_code[:] = 0


class HealsItself(Mutant):
    breaks = ("AxisDriver.read/alarms", "side effect")
    found_by = "test_faults.py::test_an_alarm_stays_until_it_is_cleared_and_then_nothing_moves"
    says = "went away by itself"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            clear = self._simulation.power.clear
            for axis in np.flatnonzero(image.amp_alarm):
                self._world.at(self._world.tick + 100, partial(clear, int(axis)))


class ReasonThatStays(Mutant):
    breaks = ("AxisDriver.read/alarms", "stale")
    found_by = "test_faults.py::test_the_reason_of_an_alarm_comes_and_goes_with_it"
    says = "goes with the alarm"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            told = self.__dict__.setdefault("told", list(image.reason))
            told[:] = [new or old for new, old in zip(image.reason, told, strict=True)]
            image.reason[:] = told


class FaultThatBlocks(Mutant):
    breaks = ("DeviceDriver.fault/blocks", "blocks")
    found_by = "test_ageing.py::test_the_device_says_at_once_why_it_is_silent"
    says = "blocks"

    class Device(SimDevice):
        def fault(self) -> str:
            time.sleep(0.01)
            return super().fault()


class ClearingEnables(Mutant):
    breaks = ("AxisDriver.clear_alarm/clears", "side effect")
    found_by = "test_faults.py::test_an_alarm_stays_until_it_is_cleared_and_then_nothing_moves"
    says = "enabled the servo"

    class Axes(SimAxes):
        def clear_alarm(self, axis: int, timeout_s: float) -> None:
            super().clear_alarm(axis, timeout_s)
            self.servo(axis, True, timeout_s)


class AlarmEndsAfterAWhile(Mutant):
    breaks = ("AxisDriver.read/alarms", "side effect")
    found_by = "test_feedback.py::test_an_alarm_stays_however_long_it_takes"

    class Axes(SimAxes):
        ticks = 3000

        def read(self, image: ProcessImage) -> None:
            super().read(image)
            seen = self.__dict__.setdefault("seen", set())
            for axis in set(np.flatnonzero(image.amp_alarm).tolist()) - seen:
                seen.add(axis)
                clear = partial(self._simulation.power.clear, axis)
                self._world.at(self._world.tick + self.ticks, clear)


class ClearsAllAlarms(Mutant):
    breaks = ("AxisDriver.clear_alarm/clears", "wrong axis")
    found_by = "test_neighbours.py::test_the_alarm_of_one_axis_is_cleared_alone"

    class Axes(SimAxes):
        def clear_alarm(self, axis: int, timeout_s: float) -> None:
            for other in range(self._simulation.axes):
                super().clear_alarm(other, timeout_s)


class ShortCodes(Mutant):
    breaks = ("AxisDriver.read/alarms", "wrong value")
    found_by = "test_feedback.py::test_a_code_is_shown_in_full_with_a_reason"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.alarm_code[:] = self._states.alarm_code & 0xFF


class SignedCodes(Mutant):
    breaks = ("AxisDriver.read/alarms", "wrong value")
    found_by = "test_feedback.py::test_a_code_is_shown_in_full_with_a_reason"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.alarm_code[:] = np.asarray(self._states.alarm_code).astype(np.int16)


class EmptyReason(Mutant):
    breaks = ("AxisDriver.read/alarms", "wrong value")
    found_by = "test_feedback.py::test_a_code_is_shown_in_full_with_a_reason"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.reason[:] = ["alarm" if alarm else "" for alarm in image.amp_alarm]


class ServoOnClearsAlarms(Mutant):
    breaks = ("AxisDriver.servo/switches", "side effect")
    found_by = "test_feedback.py::test_switching_on_clears_no_alarm"

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            if on and self._states.amp_alarm[axis]:
                self.clear_alarm(axis, timeout_s)
            super().servo(axis, on, timeout_s)


class AlarmEndsAfterALongWhile(Mutant):
    breaks = ("AxisDriver.read/alarms", "side effect")
    found_by = "test_feedback.py::test_an_alarm_stays_however_long_it_takes"

    class Axes(AlarmEndsAfterAWhile.Axes):
        ticks = 9000


class ClearsTheNextAlarmToo(Mutant):
    breaks = ("AxisDriver.clear_alarm/clears", "wrong axis")
    found_by = "test_neighbours.py::test_the_alarm_of_one_axis_is_cleared_alone"

    class Axes(SimAxes):
        def clear_alarm(self, axis: int, timeout_s: float) -> None:
            super().clear_alarm(axis, timeout_s)
            super().clear_alarm((axis + 1) % self._simulation.axes, timeout_s)


class CodesOfFourDigits(Mutant):
    breaks = ("AxisDriver.read/alarms", "wrong value")
    found_by = "test_feedback.py::test_a_code_is_shown_in_full_with_a_reason"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            np.minimum(image.alarm_code, 9999, out=image.alarm_code)


class FirstCodeOnly(Mutant):
    breaks = ("AxisDriver.read/alarms", "stale")
    found_by = "test_feedback.py::test_the_code_is_that_of_the_present_alarm"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            for axis in np.flatnonzero(image.amp_alarm).tolist():
                first = self.__dict__.setdefault("first", {})
                image.alarm_code[axis] = first.setdefault(axis, int(image.alarm_code[axis]))


class ReasonIsTheCode(Mutant):
    breaks = ("AxisDriver.read/alarms", "wrong value")
    found_by = "test_feedback.py::test_a_code_is_shown_in_full_with_a_reason"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.reason[:] = [hex(code) if code else "" for code in image.alarm_code.tolist()]


class ReasonOnEveryAxis(Mutant):
    breaks = ("AxisDriver.read/alarms", "wrong axis")
    found_by = "test_faults.py::test_the_reason_of_an_alarm_comes_and_goes_with_it"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.reason[:] = [max(image.reason)] * image.axes


class AlarmWithoutStop(Mutant):
    breaks = ("AxisDriver.read/alarms", "ignored")
    found_by = "test_faults.py::test_an_alarm_ends_the_motion_of_its_axis_alone"

    class Injector(SimFaultInjector):
        def trip(self, axis: int, code: int) -> None:
            with self._world.lock:
                self._world.advance()
                self._simulation.states.amp_alarm[axis] = True
                self._simulation.states.alarm_code[axis] = code


class AlarmShownLate(Mutant):
    breaks = ("AxisDriver.read/alarms", "stale")
    found_by = "test_faults.py::test_an_alarm_is_shown_with_its_code"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            now_ns = image.fresh_ns
            since = self.__dict__.setdefault("since", {})
            for axis in range(image.axes):
                if not image.amp_alarm[axis]:
                    since.pop(axis, None)
                elif now_ns - since.setdefault(axis, now_ns) < 1_500_000_000:
                    image.amp_alarm[axis] = False
