"""Controllers that keep their pose from one connection to the next, as real ones do.

They do not model dynamics, brakes, or the time that a real controller needs to connect.
"""

from __future__ import annotations

from typing import ClassVar

from tests.features.conformance.runs.whole_arm import ArmAxes, ArmDevice, WholeArm

from robotd.api import (
    BackendInfo,
    Capability,
    ConnectionState,
    DeviceContext,
    FloatArray,
    NotReady,
    Payload,
    PayloadDriver,
    ProcessImage,
    hookimpl,
)

DROOP_RAD = 6e-3
CARRIED = Payload(2.0, (0.0, 0.0, 0.05))


class KeptPose(WholeArm):
    """The joints stay where the last connection has left them.

    Attributes:
        position: (n_axes,) rad; None: no connection yet.
        start_rad: of every joint, before the first connection.
    """

    position: FloatArray | None = None
    start_rad = 0.0

    @hookimpl
    def robotd_open_device(self, context: DeviceContext[object]) -> ArmDevice:
        device = super().robotd_open_device(context)
        kept = type(self).position
        if kept is None:
            kept = device.controller.position + type(self).start_rad
            type(self).position = kept
        device.controller.position = kept  # shared: it outlives the connection
        return device


class NearLimit(KeptPose):
    """Starts 0.12 rad from the upper limits of the plain robot."""

    start_rad = 2.88


class Hardware(KeptPose):
    """Not declared as simulated, so that the checks run in real time and are careful."""

    @hookimpl
    def robotd_backend(self) -> BackendInfo:
        known = super().robotd_backend()
        return BackendInfo(known.summary, 1, known.capabilities - {Capability.SIMULATED})


class Carries(Hardware):
    """Compensates a payload; notes each one that is set.

    Attributes:
        payloads: set so far, of all connections.
    """

    payloads: ClassVar[list[Payload]] = []

    @hookimpl
    def robotd_payload(self, device: ArmDevice) -> PayloadDriver:
        return NotedPayload(self.payloads, device)


class NotedPayload(PayloadDriver):
    """2 kg and a gripper, until another payload is set."""

    max_kg = 3.0

    def __init__(self, noted: list[Payload], device: ArmDevice) -> None:
        self._noted, self._device, self._payload = noted, device, CARRIED

    def payload(self) -> Payload:
        return self._payload

    def set_payload(self, payload: Payload, timeout_s: float) -> None:
        self._noted.append(payload)
        if self._device.state() is not ConnectionState.COMMUNICATING:
            raise NotReady("the controller does not communicate")
        self._payload = payload


class GivesWay(KeptPose):
    """Rests below its targets, as an arm that is held by a stiffness."""

    @hookimpl
    def robotd_axes(self, device: ArmDevice, context: DeviceContext[object]) -> ArmAxes:
        return YieldingAxes(device.controller, context)


class YieldingAxes(ArmAxes):
    def read_feedback(self, image: ProcessImage) -> None:
        super().read_feedback(image)
        image.position -= DROOP_RAD


class Astray(Hardware):
    """Moves three times as far as it is commanded."""

    @hookimpl
    def robotd_axes(self, device: ArmDevice, context: DeviceContext[object]) -> ArmAxes:
        return AstrayAxes(device.controller, context)


class AstrayAxes(ArmAxes):
    """Three times the distance from where the joints were at first."""

    def send_targets(self, positions: FloatArray) -> None:
        super().send_targets(3.0 * positions)
