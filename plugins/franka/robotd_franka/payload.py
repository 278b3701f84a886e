"""Payload of the arm, besides the end effector that is set in Desk."""

from __future__ import annotations

from robotd.api import NotReady, Payload, PayloadDriver
from robotd_franka.device import FrankaDevice

MAX_KG = 3.0  # of FR3 and Panda


class FrankaPayload(PayloadDriver):
    """The load of FCI, which the control unit takes only while no client controls the arm."""

    def __init__(self, device: FrankaDevice) -> None:
        self._device = device

    @property
    def max_kg(self) -> float:
        return MAX_KG

    def payload(self) -> Payload:
        return self._device.payload

    def set_payload(self, payload: Payload, timeout_s: float) -> None:
        device = self._device
        with device.switching:
            link = device.live
            if link is None:
                raise NotReady("the arm does not communicate")
            followed = link.state is not None and link.state.followed
            if followed:  # the arm holds itself meanwhile
                device.end_following(timeout_s)
            try:
                link.set_load(payload)
                device.payload = payload
            finally:
                if followed:
                    device.follow(timeout_s)
