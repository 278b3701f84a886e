"""Payload of the arm, in the controller's model."""

from __future__ import annotations

import math

import numpy as np

from robotd.api import NotReady, Payload, PayloadDriver, Unsupported
from robotd_dobot.device import DobotDevice
from robotd_dobot.protocol import in_kg_and_mm

SAME = 0.01  # kg or mm


class DobotPayload(PayloadDriver):
    """Payload that the controller reports to compensate.

    V3 takes a payload with its centre only when it switches the arm on.
    """

    def __init__(self, device: DobotDevice) -> None:
        self._device = device

    @property
    def max_kg(self) -> float:
        return math.inf  # of the arm, whose controller rejects what is too much

    def payload(self) -> Payload | None:
        values = self._device.feedback
        return values.payload if values else None

    def set_payload(self, payload: Payload, timeout_s: float) -> None:
        device, link, wanted = self._device, self._device.exchanging, in_kg_and_mm(payload)
        if link is None:
            raise NotReady("the controller does not communicate")
        if not link.dialect.sets_payload:
            text = f"a payload on a controller {link.dialect.name}, but for payload_kg of the file"
            raise Unsupported(text)
        link.command("SetPayload", *wanted, timeout_s=timeout_s)
        device.payload = payload
        device.wait_for(
            lambda values: np.allclose(in_kg_and_mm(values.payload), wanted, atol=SAME),
            timeout_s,
            "the controller to show the payload",
        )
