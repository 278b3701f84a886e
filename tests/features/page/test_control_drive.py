"""Hold-to-run driving on the simulated clock: braking begins 150 ms after the last heartbeat."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest
from tests.core.control.base_harness import BaseHarness

from robotd.descriptor import load_robot_descriptor
from robotd.errors import NotReady
from robotd.robot import Robot, build_robot
from robotd_page.control_drive import (
    MAX_VELOCITY_M_S,
    DriveBeat,
    HeldDrive,
    drive_limits,
    drive_motions,
)
from robotd_page.held_motion import HEARTBEAT_S, RELEASED, TIMEOUT_S, JogEnd

BRAKING_S = 0.15  # from the last heartbeat until the base slows down
PERIODS = 3  # of the control loop


class Client(BaseHarness):
    """Page that holds the button of a direction."""

    def __init__(self, name: str) -> None:
        super().__init__(load_robot_descriptor(name))
        self.ended: list[JogEnd] = []
        self.held = HeldDrive(self.robot, "page 1", self.ended.append)
        self.hold = 0

    def beat(self, linear: float) -> None:
        drive = DriveBeat(type="drive", hold=self.hold, linear=linear, lateral=0.0, angular=0.0)
        self.held.beat(drive)
        self.settle()

    def press(self, linear: float = 9.0, seconds: float = 1.5) -> None:
        self.base.command(1e-3, 0.0)  # claims the wheels: time passes for as long as it takes
        self.settle()
        self.hold += 1
        for _ in range(round(seconds / HEARTBEAT_S)):
            self.beat(linear)
            self.run(HEARTBEAT_S)

    def rest(self) -> tuple[float, float, float]:
        """Return the times until the command slows down and is zero, and the stopping distance."""
        began_x, began_ns = self.base.pose.x, self.clock.now_ns()
        highest = self.base.limited.linear
        braking_s = rest_s = 0.0
        while self.base.moving:
            self.step()
            self.settle()
            passed_s = (self.clock.now_ns() - began_ns) * 1e-9
            if not braking_s and self.base.limited.linear < highest:
                braking_s = passed_s
            if not rest_s and self.base.limited.linear == 0.0:
                rest_s = passed_s
        return braking_s, rest_s, self.base.pose.x - began_x


@pytest.fixture(params=["baymax", "mobile_manipulator"])
def client(request: pytest.FixtureRequest) -> Iterator[Client]:
    client = Client(request.param)
    yield client
    client.close()


def test_the_base_slows_down_by_its_own_limits_when_heartbeats_stop(client: Client) -> None:
    client.press()
    limits = drive_limits(client.robot)
    assert limits is not None
    assert client.base.limited.linear == pytest.approx(limits.linear)  # the 9 m/s were clipped
    braking_s, rest_s, rest_m = client.rest()
    assert 0.0 < braking_s <= limits.release_s <= BRAKING_S
    assert 0.0 < rest_s <= limits.rest_s + 2 * client.period_s
    assert 0.02 < rest_m <= limits.rest_m * 1.1  # the drives follow the command


def test_a_diagonal_is_no_faster_than_a_straight_line() -> None:
    client = Client("mecanum_base")
    client.hold = 1
    for linear, lateral in ((9.0, 9.0), (0.25, -0.25)):
        drive = DriveBeat(type="drive", hold=1, linear=linear, lateral=lateral, angular=0.0)
        for _ in range(50):
            client.held.beat(drive)
            client.settle()
            client.run(HEARTBEAT_S)
        limited = client.base.limited
        assert math.hypot(limited.linear, limited.lateral) == pytest.approx(MAX_VELOCITY_M_S)
    client.close()


def test_releasing_slows_down_at_once_and_delayed_heartbeats_change_nothing(client: Client) -> None:
    client.press()
    client.held.release(client.hold, "released")
    assert client.ended == [JogEnd(client.hold, True, False, RELEASED)]
    braking_s, _, _ = client.rest()
    assert braking_s <= PERIODS * client.period_s
    for _ in range(10):
        client.beat(0.2)
    client.run(0.2)
    assert not client.base.moving


def test_late_heartbeats_end_the_hold(client: Client) -> None:
    client.press()
    client.run(TIMEOUT_S + 0.02)
    slower = client.base.limited.linear
    for _ in range(10):  # all at once, after a stall of the page
        client.beat(0.2)
    (end,) = client.ended
    assert (end.is_wanted, end.is_silent, end.reason) == (False, True, "heartbeats came late")
    client.run(0.05)
    assert client.base.limited.linear < slower
    client.press(0.1)  # a new press drives again
    assert client.base.limited.linear == pytest.approx(0.1)


def test_a_client_that_has_gone_and_a_stop_end_the_hold(client: Client) -> None:
    client.press()
    client.held.close()
    assert client.ended[-1].reason == RELEASED
    client.rest()
    client.press()
    client.robot.axes.stop_latch.engage("by the test")
    client.beat(0.2)
    assert not client.ended[-1].is_wanted
    assert "by the test" in client.ended[-1].reason
    client.held.close()  # without effect
    assert len(client.ended) == 2


@pytest.mark.parametrize(
    ("robot", "names"),
    [
        ("baymax", ["Forward", "Back", "Turn left", "Turn right"]),
        ("mecanum_base", ["Forward", "Back", "Left", "Right", "Turn left", "Turn right"]),
        ("tricycle_base", ["Forward", "Back", "Forward left", "Forward right"]),
    ],
)
def test_each_base_has_the_directions_that_it_can_go(robot: str, names: list[str]) -> None:
    made: Robot = build_robot(robot, "sim")  # not started: the directions are judged before
    limits = drive_limits(made)
    assert made.base is not None
    assert limits is not None
    motions = [*drive_motions(made.base, limits)]
    assert [motion["name"] for motion in motions] == names
    for motion in motions:
        with pytest.raises(NotReady, match="engine is not ready"):
            made.base.command(motion["linear"], motion["angular"], motion["lateral"])


def test_a_robot_without_a_base_rejects_to_drive() -> None:
    robot, ended = build_robot("cr3a", "sim"), list[JogEnd]()
    assert drive_limits(robot) is None
    held = HeldDrive(robot, "page 1", ended.append)
    held.beat(DriveBeat(type="drive", hold=1, linear=0.1, lateral=0.0, angular=0.0))
    assert "cr3a has no mobile base" in ended[0].reason or "a mobile base" in ended[0].reason
