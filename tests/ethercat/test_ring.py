"""A cable in a ring: frames enter from both ends, so that one cut loses no slave."""

from __future__ import annotations

from pathlib import Path

from tests.ethercat.robot import SMALL, started

from robotd.device.state import ConnectionState

RING = """\
    redundant_interface: ring0
    clocks: "off"
"""


def test_a_cut_cable_in_motion_loses_no_slave(tmp_path: Path) -> None:
    """The library joins the two frames: the working counter is complete and the motion goes on."""
    text = Path(SMALL).read_text(encoding="utf-8")
    key = "    simulated: true\n"
    assert key in text
    path = tmp_path / "ring.yaml"
    path.write_text(text.replace(key, key + RING), encoding="utf-8")
    with started(str(path)) as robot:
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
