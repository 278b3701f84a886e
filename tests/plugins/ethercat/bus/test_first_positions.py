"""Positions that axes show first: measured ones, of the present connection."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from tests.plugins.ethercat.bus.robot import SMALL, EthercatRobot

from robotd.clock import MonotonicClock
from robotd.descriptor import load_robot_descriptor
from robotd.device.process_image import ProcessImage
from robotd.plugin.manager import load_backend
from robotd.robot import Robot

START_RAD, PUSHED_RAD = 1.5, 0.7
SMALLEST_RAD = 1e-3


class FirstPositions:
    """First position of axis 1 after each time that it was offline."""

    def __init__(self) -> None:
        self.seen: list[float] = []
        self._was_offline = True

    def note(self, image: ProcessImage) -> None:
        if self._was_offline and not image.offline[1]:
            self.seen.append(float(image.position[1]))
        self._was_offline = bool(image.offline[1])


@pytest.fixture
def made() -> Iterator[Robot]:
    """A robot whose drives stand at ``START_RAD`` at power-on; not started."""
    descriptor = load_robot_descriptor(SMALL)
    section = dict(descriptor.backends["ethercat"])
    section["axis_defaults"] = section["axis_defaults"] | {"simulated_position_rad": START_RAD}
    changed = descriptor.model_copy(update={"backends": {"ethercat": section}})
    robot = Robot(changed, load_backend("ethercat"), MonotonicClock())
    yield robot
    robot.shutdown()


def test_the_first_position_is_measured_and_the_servo_does_not_jump(made: Robot) -> None:
    robot, first = EthercatRobot(made), FirstPositions()
    made.control_loop.every(1000, "first", first.note)
    made.start()
    assert first.seen == pytest.approx([START_RAD], abs=SMALLEST_RAD)
    assert robot.image.position[:2] == pytest.approx(START_RAD, abs=SMALLEST_RAD)


def test_a_slave_that_was_turned_while_it_was_cut_off(made: Robot) -> None:
    robot, first = EthercatRobot(made), FirstPositions()
    made.start()
    robot.inject("2 cut")
    robot.until(lambda: robot.image.offline[1])
    made.control_loop.every(1000, "first", first.note)
    robot.until(lambda: robot.device.simulation and _turns(robot))
    robot.inject("2 join")
    robot.until(
        lambda: not robot.image.offline.any() and first.seen
    )  # recorded later in the period
    assert first.seen == pytest.approx([START_RAD + PUSHED_RAD], abs=SMALLEST_RAD)
    made.recover()
    assert robot.image.position[1] == pytest.approx(START_RAD + PUSHED_RAD, abs=SMALLEST_RAD)


def _turns(robot: EthercatRobot) -> bool:
    """Turn the motor of slave 2 by hand, once it is without power; return True if it has moved."""
    assert robot.device.simulation is not None
    before = float(robot.device.simulation.inject("2 position"))
    robot.inject(f"2 push {PUSHED_RAD}")
    return float(robot.device.simulation.inject("2 position")) > before + PUSHED_RAD / 2
