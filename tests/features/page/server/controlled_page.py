"""A robot whose page can be unlocked, and what a test does with that page in Chromium."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Browser, Page, expect
from tests.features.page.server.browser import NO_WEBGL, open_page
from tests.features.page.server.viewer import wait_until

from robotd.api import Capability
from robotd.clock.simulated import PacedClock
from robotd.feature_host import FeatureHost
from robotd.robot import Robot, build_robot
from robotd_page.control_server import PageControl
from robotd_page.page_feed import RobotSource
from robotd_page.page_server import PageServer
from robotd_recorder.recorder import observed
from robotd_scenario.fault_schedule import FaultSchedule, RequestedFaults
from robotd_teach.page_panel import TeachPanel
from robotd_tool_space.feature import open_tool_space

HOLD_TIMEOUT_S = 600.0  # so that what stops a jog here is never the missing heartbeat
MOVING = 0.01  # rad/s


class Served:
    """A robot whose page can be unlocked."""

    def __init__(self, robot: Robot, control: PageControl, url: str) -> None:
        self.robot, self.url = robot, url
        self.token, self.address = control.token, control.address(url)

    def wait_until_moving(self, axis: int = 0) -> None:
        wait_until(lambda: abs(self.robot.image.velocity[axis]) > MOVING)

    def wait_until_free(self, axis: int = 0) -> None:
        wait_until(lambda: self.robot.axes.owner(axis) == "")
        assert abs(self.robot.image.velocity[axis]) < MOVING


@contextmanager
def serve(
    folder: Path, robot: str | Path = "cr3a", *, teaches: bool = False, falls: bool = False
) -> Iterator[Served]:
    """A simulated robot in paced time, which no stall of the computer disturbs.

    ``falls``: it says that nothing carries it while it is guided.
    """
    made = build_robot(robot, "sim", clock=PacedClock(1.0))
    if falls:
        made.capabilities |= {Capability.FALLS_WHEN_GUIDED}
    host = FeatureHost(made, (), "/", print)
    with observed(made, flight_folder=folder) as recorder, open_tool_space(host) as tools:
        control = PageControl(
            made,
            RequestedFaults(FaultSchedule(made)),
            tools=tools or {},
            panel=TeachPanel(made) if teaches else None,
            hold_timeout_s=HOLD_TIMEOUT_S,
        )
        source = RobotSource(recorder.tap, made.descriptor.nodes, has_control=True)
        with PageServer(source, 0, control=control) as server:
            made.start()
            yield Served(made, control, server.url)
        made.shutdown()


def light_page(browser: Browser, errors: list[str]) -> Page:
    """A page without WebGL: drawing the robot would cost most of the time here."""
    page = open_page(browser, errors)
    page.add_init_script(NO_WEBGL)
    return page


def unlock(page: Page, served: Served) -> None:
    page.goto(served.address)
    page.locator("body[data-control=yes]").wait_for()


def press(page: Page, joint: str, side: str = "plus") -> None:
    """Hold a jog button with the mouse."""
    page.get_by_label(f"{joint} {side}", exact=True).hover()
    page.mouse.down()


def says(page: Page, text: str) -> None:
    expect(page.locator("#answer")).to_contain_text(text)
