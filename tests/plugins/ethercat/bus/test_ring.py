"""A cable in a ring: frames enter from both ends, so that one cut loses no slave."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.plugins.ethercat.bus.robot import SMALL, started

from robotd.device.state import ConnectionState

PUNCTUAL = 50  # frames, however many are late
RING = """\
    redundant_interface: ring0
    clocks: "off"
"""


@pytest.fixture
def ring(tmp_path: Path) -> str:
    """File of a robot on a ring."""
    text = Path(SMALL).read_text(encoding="utf-8")
    key = "    simulated: true\n"
    assert key in text
    path = tmp_path / "ring.yaml"
    path.write_text(text.replace(key, key + RING), encoding="utf-8")
    return str(path)


def test_a_frame_is_received_in_its_own_period(ring: str) -> None:
    """It comes back at the other end, and an empty one in its place.

    A busy computer makes some of them late; without the wait for both ends all of them are.
    """
    punctual = list[bool]()
    with started(ring) as robot:
        exchange = robot.master.exchange
        robot.robot.control_loop.every(
            250, "punctual", lambda _: punctual.append(not exchange.in_flight)
        )
        robot.until(lambda: sum(punctual) > PUNCTUAL)


def test_a_cut_cable_in_motion_loses_no_slave(ring: str) -> None:
    """The library joins the two frames: the working counter is complete and the motion goes on."""
    with started(ring) as robot:
        exchange = robot.master.exchange
        with robot.robot.follower.follow(robot.request(2.0, 0.3, 0.3)):
            robot.until(lambda: robot.image.position[0] > 0.05)
            robot.inject("2 cut")  # two slaves at each end
            frames = exchange.good_frames
            robot.until(lambda: exchange.good_frames > frames + 50)
            robot.until(lambda: robot.image.position[0] > 0.15)
        assert exchange.needed == 12
        assert not robot.master.supervision.faults
        assert robot.device.state() is ConnectionState.COMMUNICATING
