"""Payloads that are not taken, or at the expense of something else."""

from __future__ import annotations

from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import Payload
from robotd_sim import SimAxes, SimPayload

SHOWN = "test_payload.py::test_the_payload_that_was_set_is_shown"
STILL = "test_payload.py::test_nothing_moves_and_servos_stay_as_they_are"
HOLDS = "test_payload.py::test_the_payload_holds_while_servos_are_switched"
MUCH = "test_payload.py::test_too_much_is_rejected_and_the_payload_before_holds"
OFFLINE = "test_payload.py::test_without_communication_nothing_is_set"


class KeepsTheFirstPayload(Mutant):
    breaks = ("PayloadDriver.set_payload/sets", "second call")
    found_by = SHOWN
    says = "was set"

    class ArmPayload(SimPayload):
        def set_payload(self, payload: Payload, timeout_s: float) -> None:
            if not self._simulation.payload.mass_kg:
                super().set_payload(payload, timeout_s)


class TakesMillimetres(Mutant):
    breaks = ("PayloadDriver.set_payload/sets", "wrong value")
    found_by = SHOWN
    says = "was set"

    class ArmPayload(SimPayload):
        def set_payload(self, payload: Payload, timeout_s: float) -> None:
            x, y, z = payload.center_m
            super().set_payload(Payload(payload.mass_kg, (1e3 * x, 1e3 * y, 1e3 * z)), timeout_s)


class ReturnsBeforeThePayloadIsInForce(Mutant):
    breaks = ("PayloadDriver.set_payload/sets", "late")
    found_by = SHOWN

    class ArmPayload(SimPayload):
        def set_payload(self, payload: Payload, timeout_s: float) -> None:
            world = self._simulation.world
            with world.lock:
                world.advance()
                world.at(world.tick + 50, lambda: super(type(self), self).set_payload(payload, 0.0))


class ShowsNoPayload(Mutant):
    """But the one of the start."""

    breaks = ("PayloadDriver.payload/shows", "stale")
    found_by = SHOWN

    class ArmPayload(SimPayload):
        def payload(self) -> Payload:
            return Payload(0.0)


class SwitchesServosOffForAPayload(Mutant):
    breaks = ("PayloadDriver.set_payload/still", "side effect")
    found_by = STILL
    says = "servos are not on"

    class ArmPayload(SimPayload):
        def set_payload(self, payload: Payload, timeout_s: float) -> None:
            super().set_payload(payload, timeout_s)
            with self._simulation.world.lock:
                for axis in range(self._simulation.axes):
                    self._simulation.power.request(axis, on=False)


class LosesThePayloadWithTheServos(Mutant):
    breaks = ("PayloadDriver.set_payload/holds", "ignored")
    found_by = HOLDS

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            super().servo(axis, on, timeout_s)
            if not on:
                self._simulation.payload = Payload(0.0)


class RejectsItsOwnLimit(Mutant):
    breaks = ("PayloadDriver.max_kg/most", "wrong value")
    found_by = MUCH

    class ArmPayload(SimPayload):
        @property
        def max_kg(self) -> float:
            return 0.0


class TakesAPayloadOffline(Mutant):
    breaks = ("PayloadDriver.set_payload/errors", "ignored")
    found_by = OFFLINE

    class ArmPayload(SimPayload):
        def set_payload(self, payload: Payload, timeout_s: float) -> None:
            self._simulation.payload = payload
