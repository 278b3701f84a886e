"""Hand guiding that does not let go, lets go of others, or holds elsewhere."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from tests.features.conformance.runs.mutants.plugin import Mutant, ReadAnew

from robotd.api import Operation, ProcessImage
from robotd_sim import SimAxes

TOGETHER = "test_guiding.py::test_axes_are_held_where_a_hand_has_left_them"
ALONE = "test_guiding.py::test_one_guided_axis_leaves_the_others_to_their_commands"
ALL = "test_guiding.py::test_no_axis_is_guided_where_one_is_off"
OTHERS = "test_guiding.py::test_what_ends_the_guiding_of_one_axis_leaves_the_others_guided"
ENDS = "test_guiding.py::test_guiding_ends_with_the_servo_an_alarm_or_communication"


class LetsNoAxisGo(Mutant):
    breaks = ("AxisDriver.begin_guiding/guides", "ignored")
    found_by = TOGETHER
    says = "not guided"

    class Axes(SimAxes):
        def begin_guiding(self, axes: Sequence[int], timeout_s: float) -> None:
            pass


class LetsTheNextAxisGo(Mutant):
    """And the one that was asked for."""

    breaks = ("AxisDriver.begin_guiding/guides", "wrong axis")
    found_by = ALONE

    class Axes(SimAxes):
        def begin_guiding(self, axes: Sequence[int], timeout_s: float) -> None:
            count = self._simulation.axes
            both = {*axes, *((axis + 1) % count for axis in axes)}
            super().begin_guiding(sorted(both), timeout_s)


class KeepsTheLastAxis(Mutant):
    breaks = ("AxisDriver.begin_guiding/guides", "last axis")
    found_by = TOGETHER

    class Axes(SimAxes):
        def begin_guiding(self, axes: Sequence[int], timeout_s: float) -> None:
            super().begin_guiding(axes[:-1] or axes, timeout_s)


class GuidesThoseThatCan(Mutant):
    breaks = ("AxisDriver.begin_guiding/all", "ignored")
    found_by = ALL
    says = "are guided"

    class Axes(SimAxes):
        def begin_guiding(self, axes: Sequence[int], timeout_s: float) -> None:
            for axis in axes:
                super().begin_guiding([axis], timeout_s)


class GuidedCommandStays(Mutant):
    """The command is where the axis was let go."""

    breaks = ("AxisDriver.begin_guiding/guides", "stale")
    found_by = TOGETHER

    class Axes(ReadAnew):
        def begin_guiding(self, axes: Sequence[int], timeout_s: float) -> None:
            super().begin_guiding(axes, timeout_s)
            self.__dict__["kept"] = self._simulation.servo.position.copy()

        def read(self, image: ProcessImage) -> None:
            super().read(image)
            guided = image.operation == int(Operation.GUIDING)
            if guided.any():
                np.copyto(image.position_command, self.__dict__["kept"], where=guided)


class ReturnsToWhereItWasLetGo(Mutant):
    """Once it is held again."""

    breaks = ("AxisDriver.begin_guiding/ends", "wrong value")
    found_by = TOGETHER

    class Axes(SimAxes):
        def begin_guiding(self, axes: Sequence[int], timeout_s: float) -> None:
            super().begin_guiding(axes, timeout_s)
            self.__dict__["kept"] = self._simulation.servo.position.copy()

        def stop(self, axes: Sequence[int]) -> None:
            guided = [axis for axis in axes if self._states.operation[axis] == Operation.GUIDING]
            super().stop(axes)
            with self._world.lock:
                for axis in guided:
                    self._motion.hold(axis, float(self.__dict__["kept"][axis]))


class QuickStopLeavesAxesFree(Mutant):
    breaks = ("AxisDriver.begin_guiding/ends", "ignored")
    found_by = TOGETHER

    class Axes(SimAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            operations = self._states.operation
            super().quick_stop([axis for axis in axes if operations[axis] != Operation.GUIDING])


class GuidedAgainAfterTheServo(Mutant):
    """An axis whose servo went off while it was guided is guided when it is on again."""

    breaks = ("AxisDriver.begin_guiding/ends", "ignored")
    found_by = ENDS

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            free = self.__dict__.setdefault("free", set())
            if self._states.operation[axis] == Operation.GUIDING and not on:
                free.add(axis)
            super().servo(axis, on, timeout_s)
            if on and axis in free:
                super().begin_guiding([axis], timeout_s)


class GuidedAxesTakeMoves(Mutant):
    breaks = ("drivers/rejects", "ignored")
    found_by = ALONE

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: object) -> None:
            if self._states.operation[axis] == Operation.GUIDING:
                self.stop([axis])
            super().move(axis, target, profile)  # type: ignore[arg-type]


class OneStopEndsAllGuiding(Mutant):
    breaks = ("AxisDriver/others", "side effect")
    found_by = OTHERS
    only = "stop"
    says = "not guided"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            guided = np.flatnonzero(self._states.operation == Operation.GUIDING).tolist()
            super().stop(sorted({*axes, *guided}) if {*axes} & {*guided} else axes)


class OneServoEndsAllGuiding(Mutant):
    breaks = ("AxisDriver/others", "side effect")
    found_by = OTHERS
    only = "servo"
    says = "not guided"

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            super().servo(axis, on, timeout_s)
            if not on:
                self.stop(np.flatnonzero(self._states.operation == Operation.GUIDING).tolist())


class OneAlarmEndsAllGuiding(Mutant):
    breaks = ("AxisDriver/others", "side effect")
    found_by = OTHERS
    only = "alarm"
    says = "not guided"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            if image.amp_alarm.any():
                self.stop(np.flatnonzero(self._states.operation == Operation.GUIDING).tolist())
