"""Mutants: Setpoints that are held ahead."""

from __future__ import annotations

from tests.features.conformance.runs.mutants.buffered import BUFFER_S, BufferedAxes
from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import NANOSECONDS


class DryWithoutAWord(Mutant):
    breaks = ("AxisDriver.stream_ran_dry/dry", "ignored")
    found_by = "test_dry_buffers.py::test_buffers_that_ran_dry_in_motion_are_reported"
    says = "without a report"

    class Axes(BufferedAxes):
        def stream_ran_dry(self, due_ns: int) -> bool:
            return False


class DryForGoodWithoutAWord(Mutant):
    breaks = ("AxisDriver.stream_ran_dry/dry", "ignored")
    found_by = "test_dry_buffers.py::test_buffers_that_ran_dry_in_motion_are_reported"
    says = "did not say so"

    class Axes(BufferedAxes):
        def ignores(self, due_ns: int) -> bool:
            return self._dry

        def stream_ran_dry(self, due_ns: int) -> bool:
            return False


class DryForGood(Mutant):
    breaks = ("AxisDriver.stream/underrun", "ignored")
    found_by = "test_dry_buffers.py::test_buffers_that_ran_dry_in_motion_are_reported"
    says = "still ignored"

    class Axes(BufferedAxes):
        def ignores(self, due_ns: int) -> bool:
            return self._dry


class DryForOnePeriod(Mutant):
    """Takes setpoints again before the path of the control loop waits."""

    breaks = ("AxisDriver.stream_ran_dry/dry", "late")
    found_by = "test_dry_buffers.py::test_buffers_that_ran_dry_in_motion_are_reported"
    says = "not an underrun"

    class Axes(BufferedAxes):
        def ignores(self, due_ns: int) -> bool:
            return self._dry and due_ns - self._taken_ns <= self._period_ns


class DryWhileFed(Mutant):
    """Takes a buffer that is not full for an empty one."""

    breaks = ("AxisDriver.stream_ran_dry/dry", "wrong value")
    found_by = "test_dry_buffers.py::test_a_stream_in_time_is_not_reported_dry"
    says = "while setpoints came in time"

    class Axes(BufferedAxes):
        def stream_ran_dry(self, due_ns: int) -> bool:
            depth = BUFFER_S * NANOSECONDS / max(1, self._period_ns)
            return self._executing and len(self._held) <= depth


class DryAtRest(Mutant):
    breaks = ("AxisDriver.stream_ran_dry/dry", "wrong value")
    found_by = "test_dry_buffers.py::test_a_stream_at_rest_is_not_reported_dry"
    says = "at rest"

    class Axes(BufferedAxes):
        def stream_ran_dry(self, due_ns: int) -> bool:
            return self._last is not None and not self._held
