"""Keys of ``backends.dobot`` in a robot's file."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from robotd.api import BackendOptions, DescriptorError, RobotDescriptor
from robotd_dobot.protocol import DIALECTS, JOINTS, V4, Dialect

Port = Annotated[int, Field(ge=1, le=65535)]
FrameIndex = Annotated[int, Field(ge=0, le=V4.max_frame)]
SECTION = "backends.dobot"


class DobotOptions(BackendOptions):
    """Address of the controller, how targets are streamed to it, and its own limits."""

    address: str = Field(description="Host name or IP address of the controller; no default.")
    controller: str = Field(
        "auto",
        pattern="^(auto|v3|v4)$",
        description="Generation: `v3`, `v4`, or `auto`, to ask it.",
    )
    command_port: Port = Field(29999, description="Commands as text; of V4 also the targets.")
    motion_port: Port = Field(30003, description="Targets, of V3 only.")
    feedback_port: Port = Field(30004, description="Packets of 1440 bytes, one every 8 ms.")
    target_period_s: float = Field(
        0.03,
        ge=0.004,
        le=0.1,
        description="Time between two targets, and `t` of `ServoJ`. V3 and V4 before 4.6 take"
        " 0.02 at least.",
    )
    lookahead: float | None = Field(
        None,
        ge=20,
        le=100,
        description="`aheadtime` of `ServoJ`, the differential part of its control; null: the"
        " controller's own, 50.",
    )
    gain: float | None = Field(
        None,
        ge=200,
        le=1000,
        description="`gain` of `ServoJ`, the proportional part; null: the controller's own, 500.",
    )
    max_target_age_s: float = Field(
        0.15,
        gt=0,
        le=1,
        description="Age of a target that the controller has not taken, after which the connection"
        " is ended, so that it is never executed late.",
    )
    velocity_deg_s: float = Field(
        180.0, gt=0, description="Speed at which the controller clips every joint."
    )
    ranges_deg: tuple[float, ...] = Field(
        (360.0, 360.0, 155.0, 360.0, 360.0, 360.0),
        description="Position in either direction beyond which the controller raises an alarm.",
    )
    payload_kg: float | None = Field(
        None,
        ge=0,
        le=30,
        description="Mass of gripper and part, set when the arm is switched on; null: that of the"
        " controller. Hand guiding needs the right one.",
    )
    payload_center_mm: tuple[float, float, float] = Field(
        (0.0, 0.0, 0.0), description="Centre of that mass from the flange: x, y, z."
    )
    tool_io: bool = Field(
        False,
        description="The two inputs and outputs of the tool are byte 2, bits 0 and 1, of the I/O."
        " Inputs are asked for every 0.1 s.",
    )
    tool_index: FrameIndex | None = Field(
        None,
        description="Tool frame of the controller, selected when the arm is switched on; null: the"
        " one that is selected. V3 has 0 to 9. Its safety walls and programs use it, robotd does"
        " not.",
    )
    user_index: FrameIndex | None = Field(
        None, description="User frame of the controller, as `tool_index`."
    )

    @property
    def frames(self) -> dict[str, int]:
        """Index of each frame to be selected, by the command that selects it."""
        wanted = {"Tool": self.tool_index, "User": self.user_index}
        return {name: index for name, index in wanted.items() if index is not None}

    def missing_frames(self, dialect: Dialect) -> dict[str, str]:
        """Return why a controller does not have a frame, by key of the options."""
        last = dialect.max_frame
        return {
            f"{name.lower()}_index": f"{index}: {dialect.name} has frames 0 to {last}"
            for name, index in self.frames.items()
            if index > last
        }

    @property
    def payload(self) -> tuple[float, ...]:
        """Arguments of the command that switches the arm on; empty: the controller's own hold."""
        return () if self.payload_kg is None else (self.payload_kg, *self.payload_center_mm)

    def check_robot(self, robot: RobotDescriptor) -> DobotOptions:
        """Require one axis for each joint, and a target period that the controller takes."""
        for what, count in (("axes", robot.axes), ("ranges_deg", len(self.ranges_deg))):
            if count != JOINTS:
                raise DescriptorError(
                    f"{what}: {count}, must be {JOINTS}: the controller moves {JOINTS} joints",
                    path=robot.path,
                    key=SECTION,
                )
        dialect = DIALECTS.get(self.controller)
        if dialect and self.target_period_s < dialect.min_target_s:
            least = f"{dialect.name} takes {dialect.min_target_s:g} s at least"
            text = f"{self.target_period_s:g} s: {least}"
            raise robot.problem(f"{SECTION}.target_period_s", text)
        for key, text in self.missing_frames(dialect).items() if dialect else ():
            raise robot.problem(f"{SECTION}.{key}", text)
        return self
