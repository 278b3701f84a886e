"""The server for Foxglove as a feature."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from pydantic import Field

from robotd.api import OperationError
from robotd.api.commands import PORT
from robotd.api.features import Feature, FeatureOption, Section

if TYPE_CHECKING:
    from robotd.api.features import FeatureHost
    from robotd_foxglove.foxglove_server import FoxgloveServer


class FoxgloveKeys(Section):
    """Keys at the top of a robot's file."""

    foxglove: int | None = Field(
        None,
        ge=0,
        le=65535,
        description="Port for the program Foxglove on the loopback interface; 0: any free one; "
        "null: not served.",
    )


FEATURE = Feature(
    summary="topics, transforms and the model of the robot for the program Foxglove",
    settings=FoxgloveKeys,
    open="robotd_foxglove.feature:open_foxglove",
    options=(
        FeatureOption(
            "--foxglove",
            "foxglove",
            "Serve the program Foxglove at ws://127.0.0.1:PORT, by default 8765.",
            "[PORT]",
            PORT,
            8765,  # where Foxglove looks for a server
        ),
    ),
    after=("recorder",),
)


@contextmanager
def open_foxglove(host: FeatureHost) -> Iterator[FoxgloveServer | None]:
    """Serve Foxglove, where a port is given."""
    port = host.robot.descriptor.settings(FoxgloveKeys).foxglove
    if port is None:
        yield None
        return
    try:
        from robotd_foxglove.foxglove_server import FoxgloveServer
    except ImportError as error:
        text = "--foxglove needs foxglove-sdk: pip install 'robotd[foxglove]'"
        raise OperationError(text) from error
    with FoxgloveServer(host.tap(), port) as server:
        yield server
