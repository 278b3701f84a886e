"""A drive that falls silent while it homes: where its zero is now, is not known."""

from __future__ import annotations

import threading

import pytest
from tests.plugins.independent.conftest import OpenBench

from robotd.errors import RobotdError

HOMING_MODE = 6


@pytest.mark.parametrize("method", [35, 37])
def test_a_silent_homing_moves_nothing_afterwards(open_bench: OpenBench, method: int) -> None:
    """It hears on: with the command of the old zero it would jump by 1.5 rad."""
    with open_bench(axis={"homing_method": method}) as bench:
        bench.robot.start()
        failures = list[str]()

        def home() -> None:
            try:
                bench.robot.axes.home(0)
            except RobotdError as error:
                failures.append(str(error))

        homing = threading.Thread(target=home)
        homing.start()
        bench.drive.wait(lambda measured: measured["mode"] == HOMING_MODE)
        bench.drive.set(mute=True)
        homing.join(60.0)
        assert failures
        bench.drive.wait(lambda measured: not measured["energised"])
        assert not bench.has_jumped()
