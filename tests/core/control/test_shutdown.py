"""What a robot knows of its servos when it has been shut down."""

from __future__ import annotations

from structlog.testing import capture_logs
from tests.core.control.harness import Harness

NOT_CONFIRMED = "servos are not confirmed to be off: cut their power"


def test_servos_that_are_off_are_confirmed(harness: Harness) -> None:
    with capture_logs() as lines:
        assert harness.robot.shutdown() == []
        assert harness.robot.shutdown() == []
    assert NOT_CONFIRMED not in [line["event"] for line in lines]


def test_a_drive_that_is_lost_is_named(harness: Harness) -> None:
    """One that was off when it was lost is off."""
    harness.robot.axes.servo(2, False)
    harness.faults.disconnect(1)
    harness.faults.disconnect(2)
    harness.run(0.1)
    with capture_logs() as lines:
        assert harness.robot.shutdown() == ["joint2"]
    [line] = [line for line in lines if line["event"] == NOT_CONFIRMED]
    assert (line["axes"], line["confirmed"]) == ("joint2", 2)


def test_a_device_that_is_lost_leaves_all_servos_unconfirmed(harness: Harness) -> None:
    harness.faults.drop_communication()
    harness.run(0.1)
    assert harness.robot.shutdown() == ["joint1", "joint2", "joint3"]
