"""Keys of the robot's file for motion of the tool: speeds, tools and work frames."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

from pydantic import Field

from robotd.api import FloatArray, did_you_mean
from robotd.api.features import (
    Name,
    NotNegative,
    Positive,
    ReducedSpeedSettings,
    Section,
    SectionProblem,
)
from robotd_tool_space.geometry.rotations import pose_of

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


class ToolSettings(FrameSettings):
    """A tool; its frame is that of its tip, in the link that carries it."""

    radius_m: Positive | None = Field(
        None,
        description="Radius of its body, from the link to the tip, which collisions count; null: it"
        " counts for nothing.",
    )


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


class CylinderSettings(FrameSettings):
    """A cylinder that the arm has to keep away from, along its z; `xyz_m` is its middle."""

    radius_m: Positive = Field(description="Its radius.")
    length_m: Positive = Field(description="Its length.")


class SphereSettings(Section):
    """A ball that the arm has to keep away from."""

    xyz_m: Numbers3 = Field(
        (0.0, 0.0, 0.0), strict=False, description="Its middle, in the base of the arm."
    )
    radius_m: Positive = Field(description="Its radius.")


class CollisionSettings(Section):
    """Motion that is rejected, or stopped, before an arm collides; no safety function."""

    links: bool = Field(True, description="Check the links of an arm against each other.")
    not_checked: list[Annotated[tuple[Name, Name], Field(strict=False)]] = Field(
        [], description="Pairs of links that are not checked against each other."
    )
    margin_m: NotNegative = Field(0.01, description="Least distance.")
    planes: dict[Name, PlaneSettings] = Field({}, description="Walls and floors by name.")
    boxes: dict[Name, BoxSettings] = Field({}, description="Boxes by name.")
    cylinders: dict[Name, CylinderSettings] = Field({}, description="Cylinders by name.")
    spheres: dict[Name, SphereSettings] = Field({}, description="Balls by name.")
    planning_scene_topic: str | None = Field(
        None,
        pattern=r"^/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*$",
        description="Topic of MoveIt's planning scene, whose objects count as well, such as"
        " `monitored_planning_scene`; null: none.",
    )

    def leaves_out(self, first: str, second: str) -> bool:
        """Return True where two links are a pair of ``not_checked``."""
        return (first, second) in self.not_checked or (second, first) in self.not_checked

    def problems(self) -> Iterator[SectionProblem]:
        known: set[str] = set()
        for key in ("planes", "boxes", "cylinders", "spheres"):
            names = getattr(self, key).keys()
            for name in sorted(known & names):
                yield (key, name), "is the name of another body, too", name
            known |= names


class ToolSpaceSettings(ReducedSpeedSettings):
    """Motion of the tool: its speed, its frames and those that it works in."""

    velocity_m_s: Positive = Field(0.25, description="Speed of the tool on a line.")
    angular_velocity_rad_s: Positive = Field(0.8, description="Angular speed of the tool.")
    acceleration_m_s2: Positive = Field(1.0, description="Acceleration of the tool on a line.")
    collisions: CollisionSettings | None = Field(
        None, description="Check of collisions, from the shapes of the URDF; null: none."
    )
    tools: dict[Name, ToolSettings] = Field(
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
