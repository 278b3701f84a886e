"""Keys of reduced speed, for the section of a feature that knows the speeds of an arm."""

from __future__ import annotations

from pydantic import Field

from robotd.descriptor.section import Positive, Section


class ReducedSpeedSettings(Section):
    """Limit, and the input that switches it on."""

    reduced_speed_m_s: Positive = Field(
        0.25, description="Highest speed of the arm while reduced speed is on."
    )
    reduced_speed_input: str | None = Field(
        None, description="Name of an input (`inputs`) that switches reduced speed on; null: none."
    )
    reduced_speed_level: int = Field(
        0, ge=0, le=1, description="Level that does; with 0 a broken wire does."
    )
