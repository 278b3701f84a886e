"""Keys of the page in a robot's file."""

from __future__ import annotations

from pydantic import Field

from robotd.descriptor.section import Section


class PageKeys(Section):
    """Keys at the top of the file."""

    page: int | None = Field(
        None,
        ge=0,
        le=65535,
        description="Port of the live page on the loopback interface; 0: any free one; null: "
        "not served.",
    )
    page_control: bool = Field(
        False,
        description="The live page can control the robot, with the token that is printed at "
        "each start; false: it only reads.",
    )
