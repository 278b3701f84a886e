"""The page of a robot process: served by the option, and by the descriptor."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Iterator
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest
from tests.page.viewer import TIMEOUT_S, Viewer, connected
from tests.ros.robot_process import RobotProcess

pytestmark = pytest.mark.ros


@pytest.fixture(scope="module")
def url() -> Iterator[str]:
    with RobotProcess("--page", "0") as process:
        process.wait_ready()
        match = re.search(r"url=(http://127\.0\.0\.1:\d+/)", process.output)
        assert match, process.output
        yield match[1]


def test_a_viewer_sees_the_robot_with_its_nodes(url: str) -> None:
    async def watch() -> Viewer:
        async with connected(url) as viewer:
            await viewer.until(lambda: viewer.state["ready"] and not viewer.state["problems"])
            count = len(viewer.samples)
            await viewer.until(lambda: len(viewer.samples) > count + 10)  # they go on coming
            return viewer

    viewer = asyncio.run(watch())
    assert viewer.description["robot"] == "cr3a"
    assert "follow_joint_trajectory_server" in viewer.description["nodes"]
    assert all(axis["servo"] for axis in viewer.state["axes"])
    assert any("servos on" in event["text"] for event in viewer.events)


def test_metrics_are_beside_the_page_and_foreign_hosts_are_rejected(url: str) -> None:
    with urlopen(f"{url}metrics", timeout=TIMEOUT_S) as answer:
        assert b"robotd_ready 1.0" in answer.read()
    with pytest.raises(HTTPError, match="403"):
        urlopen(Request(url, headers={"Host": "evil.example"}), timeout=TIMEOUT_S)
