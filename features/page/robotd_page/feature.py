"""The page as a feature."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from pydantic import Field

from robotd.api import InvalidArgument, OperationError
from robotd.api.commands import PORT
from robotd.api.features import Feature, FeatureOption, Section

if TYPE_CHECKING:
    from robotd.api.features import FeatureHost, Tap


DEFAULT_PORT = 8080


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


FEATURE = Feature(
    summary="live page of the robot in a browser",
    settings=PageKeys,
    open="robotd_page.feature:open_page",
    options=(
        FeatureOption(
            "--page",
            "page",
            "Serve the live page at http://127.0.0.1:PORT, by default 8080; 0: any free port, which"
            " the log names.",
            "[PORT]",
            PORT,
            DEFAULT_PORT,
        ),
        FeatureOption(
            "--page-control/--no-page-control",
            "page_control",
            "Let the page jog and command the robot, with a token that is printed at the start.",
        ),
    ),
    after=("recorder", "foxglove", "scenario", "teach", "tool_space"),
)


@contextmanager
def open_page(host: FeatureHost) -> Iterator[Tap | None]:
    """Serve the page where a port is given; the value is the tap that feeds it, else None."""
    keys = host.robot.descriptor.settings(PageKeys)
    if keys.page is None:
        if keys.page_control:
            text = "page_control needs a page: --page PORT, or page: in the robot's file"
            raise InvalidArgument(text)
        yield None
        return
    try:
        from robotd_page.control_server import PageControl
        from robotd_page.page_feed import RobotSource
        from robotd_page.page_server import PageServer
    except ImportError as error:
        raise OperationError("the page needs aiohttp: pip install 'robotd[page]'") from error
    host.requested.add("metrics")
    tap = host.tap()
    control = None
    if keys.page_control:
        faults = host.offered.get("faults")
        tools = host.parts.get("tool_space")
        panel = host.offered.get("panel")
        control = PageControl(
            host.robot,
            faults() if faults else None,
            tools=tools or {},
            panel=panel() if panel else None,
        )
    source = RobotSource(
        tap, host.node_names, has_control=control is not None, namespace=host.namespace
    )

    def metrics() -> bytes | None:
        text = host.parts.get("metrics")
        return text() if text else None

    with PageServer(source, keys.page, metrics, control=control) as page:
        address = control.address(page.url) if control else page.url
        host.on_ready.append(lambda: host.say(page_text(address)))
        yield tap


def page_text(address: str) -> str:
    """Return the line about the page, with the token, which no log may have."""
    controls = " moves the robot: keep it to yourself" if "#" in address else ""
    return f"page {address}{controls}"
