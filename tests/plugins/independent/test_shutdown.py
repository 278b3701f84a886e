"""What the end of a robot knows about its drive, and leaves of one that does not obey as usual."""

from __future__ import annotations

from typing import Any

import pytest
from structlog.testing import capture_logs
from tests.plugins.independent.conftest import OpenBench

OFF = ("SWITCH_ON_DISABLED", "READY")
# The drive goes on when the connection ends: its option code is 0.
GOES_ON: dict[str, Any] = {
    "skip_writes": ["0x6007"],
    "startup": [{"object": "0x6007", "value": 0}],
}


def test_a_drive_confirms_that_it_is_off(open_bench: OpenBench) -> None:
    with open_bench() as bench:
        bench.robot.start()
        assert bench.drive["energised"]
        assert bench.robot.shutdown() == []
        assert bench.drive["power"] in OFF


def test_a_stopped_node_is_switched_off_by_sdo(open_bench: OpenBench) -> None:
    """It takes no PDO any more."""
    with open_bench(axis=GOES_ON) as bench:
        bench.robot.start()
        bench.drive.do("stop")
        assert bench.drive["energised"]
        assert bench.robot.shutdown() == []
        assert bench.drive["power"] in OFF
        assert bench.drive["counts"]["boots"] == 1


def test_a_stopped_node_that_answers_no_sdo_is_reset(open_bench: OpenBench) -> None:
    with open_bench(axis=GOES_ON) as bench:
        bench.robot.start()
        bench.drive.do("stop")
        bench.drive.set(sdo_mute=(0x6041,))
        assert bench.robot.shutdown() == ["joint1"]
        assert bench.drive["power"] in OFF
        assert bench.drive["counts"]["boots"] == 2


@pytest.mark.parametrize("knobs", [{"deaf": True, "mute": True}, {"deaf": True}, {"mute": True}])
def test_a_silent_drive_is_named(open_bench: OpenBench, knobs: dict[str, bool]) -> None:
    """What only hears is off, what hears nothing stays on: robotd knows of neither."""
    with open_bench(axis=GOES_ON) as bench:
        bench.robot.start()
        bench.drive.set(**knobs)
        with capture_logs() as lines:
            assert bench.robot.shutdown() == ["joint1"]
        assert bench.drive["energised"] == knobs.get("deaf", False)
    assert lines[-1]["event"] == "servos are not confirmed to be off: cut their power"
    assert lines[-1]["axes"] == "joint1"
