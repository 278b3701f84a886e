"""Payload of the simulated arm: it is kept and shown, and changes no motion."""

from __future__ import annotations

from robotd.api import NotReady, Payload, PayloadDriver
from robotd_sim.simulation import Simulation

MAX_KG = 100.0


class SimPayload(PayloadDriver):
    """Payload that the engine was last given; none after it was closed."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation

    @property
    def max_kg(self) -> float:
        return MAX_KG

    def payload(self) -> Payload:
        return self._simulation.payload

    def set_payload(self, payload: Payload, timeout_s: float) -> None:
        with self._simulation.world.lock:
            self._simulation.world.advance()
            if not self._simulation.communicating:
                raise NotReady("the engine is not communicating")
            self._simulation.payload = payload
