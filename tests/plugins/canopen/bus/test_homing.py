"""Homing by switches that the simulated drive has, and limit switches as faults."""

from __future__ import annotations

from typing import Any

import pytest
from tests.plugins.canopen.bus.conftest import SMALL, OpenRig
from tests.plugins.canopen.bus.harness import Harness

from robotd.control.loop.setpoint_source import Outcome
from robotd.device.axes import Jog
from robotd.device.state import CommandMode
from robotd.errors import NotReady, OperationError
from robotd.motion.profile import Profile
from robotd_cia402.simulated.mode_motion import Mode

EDGE_RAD = 3e-3  # a period at creeping speed, and the stopping distance
SWITCHES = {"negative_limit_rad": -0.3, "positive_limit_rad": 0.4, "home_rad": 0.2}
ENDS, LEFT, RIGHT = (-0.3, 0.4), 0.19, 0.21


def homing(method: int, polarity: int = 1, **switches: float) -> dict[str, Any]:
    return {
        "axis_defaults": {
            "counts_per_rad": 1e5,
            "polarity": polarity,
            "homing_method": method,
            "homing_speed_rad_s": 0.8,
            "homing_creep_rad_s": 0.1,
            "homing_acceleration_rad_s2": 20.0,
            "simulated_switches": SWITCHES | switches,
        }
    }


def place(harness: Harness) -> float:
    """Position of home, relative to the motor at power-on."""
    return harness.drive(2).drives[0].motion.zero


def test_a_statusword_that_comes_rarely_ends_no_homing_early(open_rig: OpenRig) -> None:
    """In the mode before, bits 10 and 12 have another meaning."""
    keys = homing(19)
    keys["axis_defaults"]["tpdos"] = [
        {"number": 1, "transmission": 25, "objects": ["0x6041", "0x603F"]},
        {"number": 2, "transmission": 1, "objects": ["0x6061", "0x6064"]},
    ]
    with open_rig(SMALL, **keys) as harness:
        harness.robot.axes.home(1)
        assert place(harness) == pytest.approx(LEFT, abs=EDGE_RAD)


@pytest.mark.parametrize(
    ("method", "polarity", "home"),
    [
        (17, 1, ENDS[0]),
        (18, 1, ENDS[1]),
        (17, -1, ENDS[1]),  # the drive's negative end is the joint's positive one
        (19, 1, LEFT),
        (23, 1, LEFT),
    ],
)
def test_home_is_the_edge_of_the_switch(
    open_rig: OpenRig, method: int, polarity: int, home: float
) -> None:
    with open_rig(SMALL, **homing(method, polarity)) as harness:
        harness.robot.axes.home(1)
        assert place(harness) == pytest.approx(home, abs=EDGE_RAD)
        assert abs(harness.image.position[1]) < 10 * EDGE_RAD
        assert harness.image.home_done[1]
        assert harness.image.servo_on[1]
        inwards = -0.1 if home == ENDS[1] else 0.1
        assert harness.follow(0.5, inwards).outcome is Outcome.SUCCEEDED


@pytest.mark.parametrize(("method", "home_rad"), [(23, -0.1), (27, 0.2)])
def test_a_search_turns_at_the_limit_switch(
    open_rig: OpenRig, method: int, home_rad: float
) -> None:
    with open_rig(SMALL, **homing(method, home_rad=home_rad)) as harness:
        harness.robot.axes.home(1)
        edge = home_rad - 0.01 if method == 23 else home_rad + 0.01
        assert place(harness) == pytest.approx(edge, abs=EDGE_RAD)


@pytest.mark.parametrize("method", [21, 5])
def test_a_homing_that_finds_nothing_says_so(open_rig: OpenRig, method: int) -> None:
    """Method 21 searches on the wrong side; the drive does not have method 5."""
    with open_rig(SMALL, **homing(method)) as harness:
        with pytest.raises(OperationError, match=rf"elbow: node 2: homing by .*{method}.* failed"):
            harness.robot.axes.home(1)
        assert not harness.image.home_done[1]
        assert harness.image.servo_on[1]


def test_a_homing_that_moves_obeys_pause_and_speed(open_rig: OpenRig) -> None:
    with open_rig(SMALL, **homing(17)) as harness:
        robot, drive = harness.robot, harness.drive(2).drives[0]
        robot.pause()
        with pytest.raises(NotReady, match="elbow: motion is paused"):
            robot.axes.home(1)
        assert drive.motion.mode is not Mode.HOMING
        robot.set_speed(0.25)
        robot.resume()
        speeds = list[float]()
        robot.control_loop.every(
            robot.descriptor.cycle.rate_hz, "speed", lambda image: speeds.append(image.velocity[1])
        )
        robot.axes.home(1)
        assert max(map(abs, speeds)) == pytest.approx(0.2, rel=0.1)


def test_a_homing_at_rest_obeys_no_pause(open_rig: OpenRig) -> None:
    with open_rig(SMALL, **homing(37)) as harness:
        harness.robot.pause()
        harness.robot.axes.home(1)
        assert harness.image.home_done[1]


def test_a_limit_switch_stops_an_axis_with_a_reason(open_rig: OpenRig) -> None:
    with open_rig(SMALL, **homing(37)) as harness:
        axes = harness.robot.axes
        axes.set_command_mode(1, CommandMode.VELOCITY)
        axes.jog([Jog(1, Profile(0.8, 5.0, 5.0))])
        harness.until(lambda: bool(harness.image.amp_alarm[1]))
        harness.until(lambda: "EMCY 0x8612 reference limit" in harness.image.fault(1))
        harness.until(lambda: bool(harness.image.positive_limit[1]))
        assert not harness.image.negative_limit[1]
        axes.clear_alarm(1)
        axes.servo(1, True)
        axes.jog([Jog(1, Profile(-0.4, 5.0, 5.0))])
        harness.until(lambda: not harness.image.positive_limit[1])
        axes.stop([1])
        harness.idle(1)
