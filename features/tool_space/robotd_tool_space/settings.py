"""Keys of the robot's file for motion of the tool: speeds, tools and work frames."""

from __future__ import annotations

from collections.abc import Iterator

from pydantic import Field

from robotd.api import FloatArray, did_you_mean
from robotd.api.features import Name, Positive, Section, SectionProblem
from robotd_tool_space.rotations import pose_of

Numbers3 = tuple[float, float, float]


class FrameSettings(Section):
    """A frame in another one."""

    xyz_m: Numbers3 = Field((0.0, 0.0, 0.0), strict=False, description="Its origin, m.")
    rpy_rad: Numbers3 = Field(
        (0.0, 0.0, 0.0), strict=False, description="Roll, pitch and yaw about fixed axes, rad."
    )

    @property
    def pose(self) -> FloatArray:
        """The frame as a pose (4, 4)."""
        return pose_of(self.xyz_m, self.rpy_rad)


class ToolSpaceSettings(Section):
    """Motion of the tool: its speed, its frames and those that it works in."""

    velocity_m_s: Positive = Field(0.25, description="Speed of the tool on a line.")
    angular_velocity_rad_s: Positive = Field(0.8, description="Angular speed of the tool.")
    acceleration_m_s2: Positive = Field(1.0, description="Acceleration of the tool on a line.")
    reduced_speed_m_s: Positive = Field(
        0.25, description="Highest speed of the arm while reduced speed is on."
    )
    reduced_speed_input: str | None = Field(
        None, description="Name of an input (`inputs`) that switches reduced speed on; null: none."
    )
    reduced_speed_level: int = Field(
        0, ge=0, le=1, description="Level that does; with 0 a broken wire does."
    )
    tools: dict[Name, FrameSettings] = Field(
        {}, description="Tools by name: their frames in the link of the tool (`tool_link`)."
    )
    work_frames: dict[Name, FrameSettings] = Field(
        {}, description="Frames by name that poses are given in: in the base of the arm."
    )
    tool: str | None = Field(None, description="Tool at the start; null: the link itself.")
    work_frame: str | None = Field(None, description="Work frame at the start; null: the base.")

    def problems(self) -> Iterator[SectionProblem]:
        for key, chosen, known in (
            ("tool", self.tool, self.tools),
            ("work_frame", self.work_frame, self.work_frames),
        ):
            if chosen is not None and chosen not in known:
                names = ", ".join(known) or "none"
                what = f"is not in {key}s (available: {names}){did_you_mean(chosen, known)}"
                yield (key,), what, chosen


class ToolSpaceKeys(Section):
    """Keys at the top of a robot's file."""

    tool_space: ToolSpaceSettings = Field(
        ToolSpaceSettings(), description="Motion of the tool: speeds, tools, work frames."
    )
