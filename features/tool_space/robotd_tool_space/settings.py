"""Keys of the robot's file for motion of the tool: speeds, tools and work frames."""

from __future__ import annotations

from collections.abc import Iterator

from pydantic import Field

from robotd.api import FloatArray, did_you_mean
from robotd.api.features import Name, NotNegative, Positive, Section, SectionProblem
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


class PlaneSettings(Section):
    """A wall, or the floor."""

    normal: Numbers3 = Field(
        strict=False, description="Direction to where the arm may be, in its base; of any length."
    )
    distance_m: float = Field(
        0.0, description="Of the plane from the origin of the base along `normal`."
    )

    def problems(self) -> Iterator[SectionProblem]:
        if not any(self.normal):
            yield ("normal",), "must not be zero", self.normal


class BoxSettings(FrameSettings):
    """A box that the arm has to keep away from; `xyz_m` is its middle, in the base of the arm."""

    size_m: tuple[Positive, Positive, Positive] = Field(
        strict=False, description="Lengths of its edges, along its axes."
    )


class CollisionSettings(Section):
    """Motion that is rejected, or stopped, before an arm collides; no safety function."""

    links: bool = Field(True, description="Check the links of an arm against each other.")
    margin_m: NotNegative = Field(0.01, description="Least distance.")
    planes: dict[Name, PlaneSettings] = Field({}, description="Walls and floors by name.")
    boxes: dict[Name, BoxSettings] = Field({}, description="Boxes by name.")

    def problems(self) -> Iterator[SectionProblem]:
        for name in self.planes.keys() & self.boxes.keys():
            yield ("boxes", name), "is the name of a plane, too", name


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
    collisions: CollisionSettings | None = Field(
        None, description="Check of collisions, from the shapes of the URDF; null: none."
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
