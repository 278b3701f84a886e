"""Payload of the arm, which its drives carry as they carry its links."""

from __future__ import annotations

import math

from robotd.api import NotReady, Payload, PayloadDriver
from robotd_mujoco.physics import Physics


class MujocoPayload(PayloadDriver):
    """Weight that the drives expect at the last link; what hangs there has a weight of its own."""

    def __init__(self, physics: Physics) -> None:
        self._physics = physics

    @property
    def max_kg(self) -> float:
        return math.inf  # torque limits of the drives apply

    def payload(self) -> Payload:
        return self._physics.payload

    def set_payload(self, payload: Payload, timeout_s: float) -> None:
        with self._physics.lock:
            self._physics.advance()
            if not self._physics.talking:
                raise NotReady("the drives do not answer")
            self._physics.expect(payload)
