"""Keys of ``backends.dobot_tcp`` in a robot's file."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from robotd.api import BackendOptions, DescriptorError, RobotDescriptor

JOINTS = 6
Port = Annotated[int, Field(ge=1, le=65535)]


class DobotOptions(BackendOptions):
    """Address of the controller, and its own limits."""

    address: str = Field(description="Host name or IP address of the controller; no default.")
    dashboard_port: Port = Field(29999, description="Commands as text, each with a reply.")
    motion_port: Port = Field(30003, description="Streamed joint targets.")
    feedback_port: Port = Field(30004, description="Packets of 1440 bytes, one every 8 ms.")
    target_period_s: float = Field(
        0.008, ge=0.002, le=0.1, description="Time for each streamed target, its parameter `t`."
    )
    max_target_age_s: float = Field(0.05, gt=0, description="Age without a reply that is fatal.")
    velocity_deg_s: float = Field(
        180.0, gt=0, description="Speed at which the controller clips every joint."
    )
    ranges_deg: tuple[float, ...] = Field(
        (360.0, 360.0, 155.0, 360.0, 360.0, 360.0),
        description="Position in either direction beyond which the controller raises an alarm.",
    )

    def check_robot(self, robot: RobotDescriptor) -> DobotOptions:
        """Require one axis for each joint of the controller."""
        for what, count in (("axes", robot.axes), ("ranges_deg", len(self.ranges_deg))):
            if count != JOINTS:
                raise DescriptorError(
                    f"{what}: {count}, must be {JOINTS}: the controller moves {JOINTS} joints",
                    path=robot.path,
                    key="backends.dobot_tcp",
                )
        return self
