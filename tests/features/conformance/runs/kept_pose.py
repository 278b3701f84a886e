"""Controllers that keep their pose from one connection to the next, as real ones do.

They do not model dynamics, brakes, or the time that a real controller needs to connect.
"""

from __future__ import annotations

from tests.features.conformance.runs.whole_arm import ArmAxes, ArmDevice, WholeArm

from robotd.api import BackendInfo, Capability, DeviceContext, FloatArray, hookimpl


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


class Astray(Hardware):
    """Moves three times as far as it is commanded."""

    @hookimpl
    def robotd_axes(self, device: ArmDevice, context: DeviceContext[object]) -> ArmAxes:
        return AstrayAxes(device.controller, context)


class AstrayAxes(ArmAxes):
    """Three times the distance from where the joints were at first."""

    def send_targets(self, positions: FloatArray) -> None:
        super().send_targets(3.0 * positions)
