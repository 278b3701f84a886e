"""Pages of robots in other processes, over DDS."""

from __future__ import annotations

import asyncio
import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import expect
from std_srvs.srv import Trigger
from tests.features.page.server.browser import chromium, needs_browser, open_page
from tests.features.page.server.viewer import connected, listed
from tests.ros.robot_process import WAIT_S, Client, RobotProcess, wait_until

from robotd_testing.domain import own_domain

pytestmark = pytest.mark.ros


@pytest.fixture(scope="module")
def domain() -> Iterator[int]:
    with own_domain() as number:
        yield number


@pytest.fixture(scope="module")
def arm(domain: int) -> Iterator[RobotProcess]:
    arguments = ("--ros-args", "-r", "__ns:=/left")
    with RobotProcess(*arguments, domain=domain) as process:
        process.wait_ready()
        yield process


@pytest.fixture(scope="module")
def url(domain: int) -> Iterator[str]:
    with remote_page(domain) as address:
        yield address


@contextmanager
def remote_page(domain: int) -> Iterator[str]:
    """``robotd page`` in a process of its own."""
    environment = os.environ | {
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }
    with tempfile.TemporaryFile("w+") as log:
        command = [sys.executable, "-m", "robotd", "page", "0"]
        process = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, env=environment)
        try:
            output = Path(f"/proc/self/fd/{log.fileno()}")
            pattern = r"robots of ROS domain \d+: (http://127\.0\.0\.1:\d+/)"
            match = wait_until(lambda: re.search(pattern, output.read_text()), "the page")
            yield match[1]
        finally:
            process.send_signal(signal.SIGINT)
            assert process.wait(WAIT_S) == 0, output.read_text()


def test_a_viewer_sees_a_robot_of_another_process(arm: RobotProcess, url: str) -> None:
    async def watch() -> None:
        await listed(url, "/left")
        async with connected(url, "/left") as viewer:
            assert viewer.description["robot"] == "cr3a"
            assert "follow_joint_trajectory_server" in viewer.description["nodes"]
            await viewer.until(lambda: viewer.state["ready"] and not viewer.state["problems"])
            count = len(viewer.samples)
            await viewer.until(lambda: len(viewer.samples) > count + 10)
            client = Client(arm.domain)
            try:
                answer = await asyncio.to_thread(client.call, Trigger, "/left/robotd/stop")
                assert answer.success
                await viewer.until(lambda: viewer.state["problems"])
                assert viewer.state["problems"][0]["remedy"].endswith("robotd reset")
                await viewer.until(lambda: "stop service" in str(viewer.events))
                client.call(Trigger, "/left/robotd/reset")
            finally:
                client.close()

    asyncio.run(watch())


@needs_browser
def test_the_page_lists_robots_and_shows_one_that_has_gone_as_lost(
    arm: RobotProcess, url: str
) -> None:
    errors: list[str] = []
    with chromium() as browser:
        page = open_page(browser, errors)
        page.goto(url)  # the only robot is shown by itself
        expect(page.locator("#robot")).to_have_text("cr3a")
        expect(page.locator("#robots a[aria-current=page]")).to_have_text("left · cr3a")
        expect(page.locator("tbody[data-axis=joint1]")).to_contain_text("+0.0000 rad")
        with RobotProcess(domain=arm.domain, robot="baymax") as base:
            base.wait_ready()
            expect(page.locator("#robots a")).to_have_text(["baymax", "left · cr3a"])
            arm.process.kill()
            expect(page.locator("#lost")).to_contain_text("The robot /left does not answer")
            expect(page.locator("body")).to_have_class("lost")
            page.locator("#robots a", has_text="baymax").click()
            expect(page.locator("#robot")).to_have_text("baymax")
            expect(page.locator("#ready")).to_have_text("ready")
            expect(page.locator("#lost")).to_be_hidden()
    assert not errors
