"""Hold-to-run jog on the simulated clock: it runs while heartbeats arrive, and no longer."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace
from typing import Any

import pytest

from robotd.clock.simulated import SteppedClock
from robotd.descriptor import load_robot_descriptor, parse_override
from robotd.errors import InvalidArgument
from robotd.motion import TrajectoryRequest
from robotd.plugin.manager import load_backend
from robotd.robot import Robot, build_robot
from robotd_page.control_jog import STOP_S, HeldJoint, JogBeat, jog_velocities
from robotd_page.held_motion import HEARTBEAT_S, REACHED, RELEASED, TIMEOUT_S, JogEnd

PATIENCE_S = 30.0
JOINT = "joint2"
AXIS = 1
AT_REST = 1e-3  # rad/s, of a measured velocity


class Client:
    """Page that holds buttons of a robot in stepped time.

    Only one thread uses the clock at a time: this one waits while a worker opens or closes.
    """

    def __init__(self, robot: Robot, name: str = "page 1") -> None:
        self.robot = robot
        self.ended: list[JogEnd] = []
        self.workers = ThreadPoolExecutor(4)
        self.jog = HeldJoint(robot, name, self.workers, self.ended.append)
        self.hold = 0

    def press(self, velocity: float = 9.0, step: float | None = None) -> None:
        """Send the first heartbeat and wait until the joint can be moved, or cannot."""
        self.hold += 1
        count = len(self.ended)
        self.beat(velocity, step)
        wait_until(lambda: len(self.ended) > count or self._is_open())

    def beat(self, velocity: float = 9.0, step: float | None = None) -> None:
        jog = JogBeat(type="jog", hold=self.hold, joint=JOINT, velocity=velocity, step=step)
        self.jog.beat(jog)

    def hold_for(self, seconds: float, velocity: float = 9.0, step: float | None = None) -> None:
        for _ in range(round(seconds / HEARTBEAT_S)):
            self.beat(velocity, step)
            self.run(HEARTBEAT_S)

    def run(self, seconds: float) -> None:
        self.robot.step(round(seconds * self.robot.descriptor.cycle.rate_hz))

    def end(self) -> JogEnd:
        """Wait for the report of the last hold."""
        wait_until(lambda: self.ended and self.ended[-1].hold == self.hold)
        return self.ended[-1]

    @property
    def position(self) -> float:
        return float(self.robot.image.position[AXIS])

    @property
    def velocity(self) -> float:
        return float(self.robot.image.velocity[AXIS])

    def _is_open(self) -> bool:
        hold = self.jog._hold
        return hold is not None and hold.motion is not None


def wait_until(condition: Callable[[], Any]) -> None:
    deadline_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline_s, "timeout"
        time.sleep(0.002)


@pytest.fixture
def robot() -> Iterator[Robot]:
    robot = build_robot("cr3a", "sim", clock=SteppedClock())
    robot.start()
    robot.step(50)
    yield robot
    robot.shutdown()


@pytest.fixture
def client(robot: Robot) -> Iterator[Client]:
    client = Client(robot)
    yield client
    client.jog.close()
    robot.step(500)
    client.workers.shutdown()


def test_a_joint_moves_while_heartbeats_arrive_and_stops_when_released(client: Client) -> None:
    client.press(0.1)
    client.hold_for(1.0, 0.1)
    assert client.velocity == pytest.approx(0.1, abs=2e-3)
    assert client.robot.axes.owner(AXIS) == "page 1"
    client.jog.release(client.hold, RELEASED)
    client.run(STOP_S)
    assert abs(client.velocity) < AT_REST
    assert client.end() == JogEnd(1, True, False, RELEASED)
    assert client.robot.axes.owner(AXIS) == ""
    assert client.position == pytest.approx(0.1, abs=0.01)
    (command,) = [event for event in client.robot.events.since(0)[0] if event.subject == "jog"]
    assert (command.sender, command.text) == ("page 1", "jog: joint2, velocity 0.1")


@pytest.mark.parametrize("held_s", [0.02, 0.04, 0.06, 0.1, 0.6])
def test_a_joint_at_any_speed_stands_150_ms_after_the_last_heartbeat(
    client: Client, held_s: float
) -> None:
    client.press(-9.0)  # as fast as a page may
    client.hold_for(held_s, -9.0)
    client.run(STOP_S - HEARTBEAT_S)
    assert abs(client.velocity) < AT_REST
    rests = client.position
    client.run(0.5)
    assert client.position == pytest.approx(rests, abs=1e-4)
    assert client.end() == JogEnd(1, False, True, f"no command for {TIMEOUT_S:g} s")


def test_heartbeats_after_a_silence_move_nothing_before_the_button_is_pressed_anew(
    client: Client,
) -> None:
    client.press()
    client.hold_for(0.2)
    client.run(0.5)
    client.end()
    rests = client.position
    client.hold_for(0.3)
    assert client.position == pytest.approx(rests, abs=1e-6)
    client.press()
    client.hold_for(0.3)
    assert client.position > rests + 0.02


def test_a_hold_that_is_released_before_its_stream_is_open_moves_nothing(robot: Robot) -> None:
    client = Client(robot)
    client.hold = 1
    with robot.groups.only.motion.lock:  # nobody can open a stream now
        client.beat()
        client.jog.release(1, RELEASED)
    client.hold_for(0.01)
    wait_until(lambda: client.ended or robot.axes.owner(AXIS))
    while not client.ended:
        client.run(0.02)
        time.sleep(0.01)
    assert client.ended == [JogEnd(1, True, False, RELEASED)]
    assert client.position == pytest.approx(0.0, abs=1e-6)
    client.workers.shutdown()


def test_a_client_that_goes_stops_its_joint(client: Client) -> None:
    client.press()
    client.hold_for(0.3)
    client.jog.close()
    client.run(STOP_S)
    assert abs(client.velocity) < AT_REST
    assert client.end() == JogEnd(1, False, False, "connection closed")


@pytest.mark.parametrize("step", [0.1, -0.02])
def test_a_step_ends_at_its_target(client: Client, step: float) -> None:
    client.press(0.1, step)
    client.hold_for(abs(step) / 0.1 + 0.4, 0.1, step)
    end = client.end()
    assert (end.is_wanted, end.is_silent, end.reason) == (True, False, REACHED)
    assert client.position == pytest.approx(step, abs=1e-4)


def test_a_step_that_is_cut_short_tells_what_remains(client: Client) -> None:
    client.press(0.1, 0.1)
    client.hold_for(0.5, 0.1, 0.1)
    client.run(0.5)
    end = client.end()
    assert end.is_silent
    assert end.remaining == pytest.approx(0.1 - client.position, abs=1e-4)
    client.press(0.1, end.remaining)
    client.hold_for(1.2, 0.1, end.remaining)
    assert client.end().reason == REACHED
    assert client.position == pytest.approx(0.1, abs=1e-4)


def test_a_step_keeps_to_the_velocity_of_the_page(client: Client) -> None:
    client.press(0.05, 0.1)
    client.hold_for(1.0, 0.05, 0.1)
    assert client.velocity == pytest.approx(0.05, abs=2e-3)


def test_the_speed_of_the_operator_scales_a_jog(client: Client) -> None:
    client.robot.set_speed(0.5)
    client.press(0.1)
    client.hold_for(0.5, 0.1)
    assert client.velocity == pytest.approx(0.05, abs=2e-3)


@pytest.mark.parametrize(
    ("jog", "reason"),
    [
        ({"joint": "joint9"}, "unknown joint 'joint9'"),
        ({"velocity": 0.0}, "joint2: the jog velocity is 0"),
        ({"step": 4.0}, "joint2: target 4.0000 rad is outside -3.14 to 3.14 rad"),
    ],
)
def test_a_wrong_jog_is_rejected_with_the_reason(
    client: Client, jog: dict[str, Any], reason: str
) -> None:
    client.hold = 1
    fields = {"type": "jog", "hold": 1, "joint": JOINT, "velocity": 0.1} | jog
    client.jog.beat(JogBeat.model_validate(fields))
    end = client.end()
    assert not end.is_wanted
    assert reason in end.reason


def test_an_internal_error_ends_a_hold_with_its_text(
    client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise ValueError("of numpy")

    monkeypatch.setattr(client.jog, "open", fail)
    logged: list[str] = []
    monkeypatch.setattr("robotd_page.held_motion.log", SimpleNamespace(exception=logged.append))
    client.press()
    end = client.end()
    assert end.reason == "robotd failed: of numpy"
    assert not end.is_wanted
    assert client.jog._hold is None
    assert logged == ["a hold of the page failed"]


def test_a_stopped_robot_rejects_a_jog(client: Client) -> None:
    client.robot.stop("by a test")
    client.press()
    reason = "motion is stopped: by a test; robotd reset allows it again"
    assert client.end() == JogEnd(1, False, False, reason)


def test_a_joint_that_moves_for_another_client_is_rejected_by_its_name(client: Client) -> None:
    request = TrajectoryRequest.from_rows(client.robot.joint_names, [2.0], [[0.5] * 6])
    with client.robot.follower.follow(request):
        client.run(0.2)
        client.press()
        assert "in use by trajectory" in client.end().reason
        client.run(3.0)


def test_two_pages_do_not_take_a_joint_from_each_other(client: Client) -> None:
    client.press()
    client.hold_for(0.2)
    other = Client(client.robot, "page 2")
    other.press()
    assert "in use by page 1" in other.end().reason
    other.workers.shutdown()


def test_a_stop_ends_a_jog_with_its_reason(client: Client) -> None:
    client.press()
    client.hold_for(0.3)
    client.robot.axes.stop_latch.engage("by a test")
    client.run(STOP_S)
    assert abs(client.velocity) < AT_REST
    assert client.end().reason == "stopped: by a test"


def test_the_highest_jog_velocity_is_within_the_limits(robot: Robot) -> None:
    velocities = jog_velocities(robot)
    assert [*velocities] == [*robot.joint_names]
    assert 0.1 < velocities[JOINT] < robot.axes.limits[AXIS].velocity


@pytest.mark.parametrize("rate_hz", [10, 20, 30])
def test_a_slow_control_loop_allows_no_jog(rate_hz: int) -> None:
    """Else the joint would move on after the time that the page promises."""
    override = parse_override(f"cycle.rate_hz={rate_hz}")
    descriptor = load_robot_descriptor("cr3a", overrides=[override])
    robot = Robot(descriptor, load_backend("sim"), SteppedClock())
    assert set(jog_velocities(robot).values()) == {0.0}
    jog = HeldJoint(robot, "page 1", ThreadPoolExecutor(1), lambda end: None)
    with pytest.raises(InvalidArgument, match=f"cycle.rate_hz {rate_hz}; it takes more than 33 Hz"):
        jog.jog(JOINT, 0.1, None)
