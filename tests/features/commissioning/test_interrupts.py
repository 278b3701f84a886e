"""Ctrl-C while a commissioning ends: the servo goes off whatever comes."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

import pytest

from robotd.descriptor import load_robot_descriptor
from robotd.plugin.manager import load_backend
from robotd_commissioning import session

SIGNALS = (signal.SIGINT, signal.SIGHUP, signal.SIGTERM, signal.SIGINT)
ROBOT = """\
schema: 1
name: mine
joints:
  - {name: a, axis: 0, lower_rad: -1, upper_rad: 1, velocity_rad_s: 1, acceleration_rad_s2: 4}
backends:
  canopen:
    axes: [{axis: 0, node: 1, counts_per_rad: 1000.0}]
"""


class EnergisedRobot:
    """Robot whose start is left, and whose shut-down is interrupted several times."""

    def __init__(self, *_: Any) -> None:
        self.servo_on = True
        robots.append(self)

    def start(self, *, enable: bool) -> None:
        raise KeyboardInterrupt

    def shutdown(self) -> None:
        for number in SIGNALS:
            os.kill(os.getpid(), number)
        self.servo_on = False


robots: list[EnergisedRobot] = []


def test_ctrl_c_again_leaves_no_servo_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text(ROBOT)
    monkeypatch.setattr(session, "Robot", EnergisedRobot)
    handlers = {signum: signal.signal(signum, signal.default_int_handler) for signum in {*SIGNALS}}
    never: Any = None
    try:
        commissioning = session.Commissioning(
            lambda _: load_robot_descriptor(path),
            load_backend("canopen"),
            "a",
            session.CommissionRecord(path),
            never,
        )
        with pytest.raises(KeyboardInterrupt):
            commissioning.run()
        assert {signal.getsignal(signum) for signum in SIGNALS} == {signal.default_int_handler}
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    assert [robot.servo_on for robot in robots] == [False]
