"""Keys of ``backends.franka`` in a robot's file."""

from __future__ import annotations

import ipaddress
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from robotd.api import BackendOptions, DescriptorError, Payload, RobotDescriptor

JOINTS = 7
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
PerJoint = tuple[NotNegative, ...]


MAX_FORCE_N = 70.0  # that the hand holds continuously


class HandOptions(BaseModel):
    """The Franka Hand at the flange; its connection is the arm's."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    speed_m_s: float = Field(
        0.05, gt=0, le=0.1, description="Speed of the distance between the fingers."
    )
    force_n: float = Field(
        30.0,
        gt=0,
        le=MAX_FORCE_N,
        description="Force with which it holds a part, unless a goal has one.",
    )


class FrankaOptions(BackendOptions):
    """Address of the arm, its impedance, and what it carries."""

    address: str = Field(
        "", description="Host name or IP address of the arm's control unit; no default."
    )
    model: Literal["fr3", "panda"] = Field("fr3", description="Arm whose limits apply.")
    realtime: bool | None = Field(
        None,
        description="Require a PREEMPT_RT kernel; null: unless the address is this computer.",
    )
    stiffness: PerJoint = Field(
        (600.0, 600.0, 600.0, 600.0, 250.0, 150.0, 50.0),
        description="Torque per deviation of each joint from its target, N·m/rad.",
    )
    damping: PerJoint | None = Field(
        None, description="Torque per velocity, N·m·s/rad; null: 2·√stiffness."
    )
    collision_torque_nm: Positive = Field(
        20.0, description="External torque of a joint at which the arm stops, N·m."
    )
    collision_force_n: Positive = Field(
        30.0, description="External force at the tool, N, or torque, N·m, at which the arm stops."
    )
    load_kg: NotNegative = Field(
        0.0, description="Mass that the flange carries besides the end effector set in Desk, kg."
    )
    load_center_m: tuple[float, float, float] = Field(
        (0.0, 0.0, 0.0), description="Its centre of mass in the frame of the flange, m."
    )
    load_inertia_kg_m2: tuple[NotNegative, NotNegative, NotNegative] = Field(
        (0.0, 0.0, 0.0), description="Its moments of inertia about x, y and z, kg·m²."
    )

    hand: HandOptions | None = Field(
        None, description="The Franka Hand; null: none. Output 0.0 closes it."
    )

    def check_robot(self, robot: RobotDescriptor) -> FrankaOptions:
        """Require one axis and one gain for each joint. Raises DescriptorError."""
        counts = {
            "axes": robot.axes,
            "backends.franka.stiffness": len(self.stiffness),
            "backends.franka.damping": JOINTS if self.damping is None else len(self.damping),
        }
        for key, count in counts.items():
            if count != JOINTS:
                raise DescriptorError(
                    f"{key}: {count}, must be {JOINTS}: the arm has {JOINTS} joints",
                    path=robot.path,
                    key="backends.franka",
                )
        return self

    @property
    def payload(self) -> Payload:
        """The load as a payload, without its inertia."""
        return Payload(self.load_kg, self.load_center_m)

    @property
    def needs_realtime(self) -> bool:
        """The connection is refused without a real-time kernel."""
        return not is_loopback(self.address) if self.realtime is None else self.realtime


def is_loopback(address: str) -> bool:
    """Return whether ``address`` is this computer."""
    try:
        return ipaddress.ip_address(address).is_loopback
    except ValueError:
        return address == "localhost"
