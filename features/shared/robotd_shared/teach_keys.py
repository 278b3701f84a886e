"""Keys of the robot's file about what it was taught."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field

from robotd.api.features import Section


class TeachKeys(Section):
    """Keys at the top of a robot's file."""

    on_request: ClassVar[bool] = True
    poses: str | None = Field(
        None,
        description="File of the poses that `robotd pose` saves, relative to the robot's file;"
        " null: `robotd/poses/NAME.yaml` in `$XDG_STATE_HOME`, by default `~/.local/state`."
        " `robotd path` has its folder `paths` beside it, and the page its folder `programs`; null:"
        " `robotd/paths/NAME` and `robotd/programs/NAME`.",
    )
