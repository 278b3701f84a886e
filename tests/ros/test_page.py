"""The page of a robot process: served by the option, and by the descriptor."""

from __future__ import annotations

import asyncio
import os
import re
import sys
from collections.abc import Iterator
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest
from tests.features.page.server.viewer import TIMEOUT_S, Viewer, connected
from tests.ros.robot_process import RobotProcess

pytestmark = [pytest.mark.daily, pytest.mark.ros]


@pytest.fixture(scope="module")
def process() -> Iterator[RobotProcess]:
    with RobotProcess("--page", "0", "--foxglove", "0") as process:
        process.wait_ready()
        yield process


def printed(process: RobotProcess, pattern: str) -> str:
    """Address that the process has logged."""
    match = re.search(rf"url=({pattern})", process.output)
    assert match, process.output
    return match[1]


@pytest.fixture(scope="module")
def url(process: RobotProcess) -> str:
    return printed(process, r"http://127\.0\.0\.1:\d+/")


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


@pytest.mark.long
def test_foxglove_sees_the_joints_move(process: RobotProcess) -> None:
    pytest.importorskip("foxglove", reason="no foxglove-sdk: pip install 'robotd[foxglove]'")
    from tests.features.foxglove.test_foxglove import client_of

    async def watch() -> None:
        async with client_of(printed(process, r"ws://127\.0\.0\.1:\d+")) as viewer:
            await viewer.subscribe("/joint_states", "/tf", "/robot_description")
            await viewer.until(lambda: len(viewer.newest) == 3)
            assert "<robot" in viewer.read("/robot_description").data
            assert viewer.read("/joint_states").name[0] == "joint1"
            start = viewer.read("/joint_states").position[0]
            variables = {
                "ROS_DOMAIN_ID": str(process.domain),
                "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            }
            goal = await asyncio.create_subprocess_exec(
                *(sys.executable, "-m", "robotd", "move", f"joint1={start + 0.3}"),
                env=os.environ | variables,
            )
            await viewer.until(lambda: viewer.read("/joint_states").position[0] > start + 0.29)
            assert await asyncio.wait_for(goal.wait(), TIMEOUT_S) == 0

    asyncio.run(watch())


def test_metrics_are_beside_the_page_and_foreign_hosts_are_rejected(url: str) -> None:
    with urlopen(f"{url}metrics", timeout=TIMEOUT_S) as answer:
        assert b"robotd_ready 1.0" in answer.read()
    with pytest.raises(HTTPError, match="403"):
        urlopen(Request(url, headers={"Host": "evil.example"}), timeout=TIMEOUT_S)
