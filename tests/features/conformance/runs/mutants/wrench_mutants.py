"""Wrenches that are old, made up, or of links that do not exist."""

from __future__ import annotations

import time
from collections.abc import Sequence

from tests.features.conformance.runs.mutants.plugin import Mutant, SimWrenches

from robotd.api import FloatArray


class NamesALinkThatDoesNotExist(Mutant):
    breaks = ("WrenchDriver.links/names", "wrong value")
    found_by = "test_wrenches.py::test_the_links_of_wrenches_are_those_of_the_urdf"
    says = "the URDF has no link flange"
    robot = "cr3a"

    class Wrenches(SimWrenches):
        links: Sequence[str] = ("flange",)


class LeavesOutTheLastTorque(Mutant):
    breaks = ("WrenchDriver.read/fills", "ignored")
    found_by = "test_wrenches.py::test_wrenches_are_renewed_with_their_time"
    says = "values were not written"
    robot = "cr3a"

    class Wrenches(SimWrenches):
        def read(self, wrenches: FloatArray) -> int:
            last = wrenches[0, 5]
            taken_ns = super().read(wrenches)
            wrenches[0, 5] = last
            return taken_ns


class KeepsTheFirstWrench(Mutant):
    breaks = ("WrenchDriver.read/taken", "stale")
    found_by = "test_wrenches.py::test_wrenches_are_renewed_with_their_time"
    says = "the time of the wrenches does not go on"
    robot = "cr3a"

    class Wrenches(SimWrenches):
        first_ns = 0

        def read(self, wrenches: FloatArray) -> int:
            self.first_ns = self.first_ns or super().read(wrenches)
            super().read(wrenches)
            return self.first_ns


class TellsTheTimeInMicroseconds(Mutant):
    breaks = ("WrenchDriver.read/taken", "wrong value")
    found_by = "test_wrenches.py::test_wrenches_are_renewed_with_their_time"
    says = "s old, limit"
    robot = "cr3a"

    class Wrenches(SimWrenches):
        def read(self, wrenches: FloatArray) -> int:
            return super().read(wrenches) // 1000


class WaitsForAWrench(Mutant):
    breaks = ("WrenchDriver.read/blocks", "blocks")
    found_by = "test_wrenches.py::test_a_wrench_is_read_at_once"
    says = "a read takes"
    robot = "cr3a"

    class Wrenches(SimWrenches):
        def read(self, wrenches: FloatArray) -> int:
            time.sleep(0.02)
            return super().read(wrenches)


class KnowsAWrenchWithoutCommunication(Mutant):
    breaks = ("WrenchDriver.read/unknown", "stale")
    found_by = "test_wrenches.py::test_no_wrench_is_known_without_communication"
    says = "wrenches are known without communication"
    robot = "cr3a"

    class Wrenches(SimWrenches):
        def read(self, wrenches: FloatArray) -> int:
            taken_ns = super().read(wrenches)
            wrenches[:] = 0.0
            return taken_ns
