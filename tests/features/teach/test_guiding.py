"""Hand guiding on a stepped clock: what begins it, what ends it, and what is held afterwards."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress

import numpy as np
import pytest

import robotd_sim
from robotd import InvalidArgument, NotReady, OperationError, Robot, RobotdError, open_robot
from robotd.api import Capability, Operation, Profile, Unsupported
from robotd.api.robots import Move, SteppedClock, TrajectoryRequest
from robotd_teach.hand_guiding import HandGuiding

STEP_RAD = 0.002  # of a hand in a control period, 1 rad/s at 500 Hz


@pytest.fixture(params=["sim", "mujoco"])
def robot(request: pytest.FixtureRequest) -> Iterator[Robot]:
    with open_robot("cr3a", request.param, clock=SteppedClock()) as robot:
        yield robot


@pytest.fixture
def guiding(robot: Robot) -> HandGuiding:
    return robot.feature(HandGuiding)


def lead(robot: Robot, delta: float, axis: int = 0) -> None:
    """Move an axis by hand, at 1 rad/s."""
    for _ in range(round(abs(delta) / STEP_RAD)):
        robot.fault_injector.move_by_hand(axis, float(np.copysign(STEP_RAD, delta)))
        robot.step(1)


def operations(robot: Robot) -> set[int]:
    return {int(operation) for operation in robot.image.operation}


def rest(robot: Robot) -> None:
    for _ in range(500):
        robot.step(1)
        if operations(robot) == {Operation.IDLE}:
            return
    raise AssertionError(f"not at rest: {robot.image.operation}")


def ending(robot: Robot, guiding: HandGuiding) -> str:
    """Return why guiding has ended by itself."""
    for _ in range(1000):
        try:
            guiding.keep()
        except NotReady as error:
            rest(robot)
            return str(error)
        robot.step(1)
    raise AssertionError("it goes on")


def test_joints_are_led_and_held_where_they_were_left(robot: Robot, guiding: HandGuiding) -> None:
    with guiding.guided():
        assert operations(robot) == {Operation.GUIDING}
        lead(robot, 0.4)
        lead(robot, -0.1, axis=2)
        state = guiding.keep()
    assert list(state.joints.values()) == pytest.approx([0.4, 0, -0.1, 0, 0, 0], abs=2e-3)
    assert 0.0 < state.speed < 1.5
    assert robot.image.servo_on.all()
    robot.step(200)
    assert robot.image.position == pytest.approx([0.4, 0, -0.1, 0, 0, 0], abs=2e-3)
    assert robot.image.position_command == pytest.approx(robot.image.position, abs=1e-3)
    assert not robot.problems
    request = TrajectoryRequest(robot.joint_names, np.array([2.0]), np.zeros((1, 6)))
    with robot.follower.follow(request) as execution:
        robot.step(1500)
        assert execution.outcome is not None
    assert robot.image.position == pytest.approx([0.0] * 6, abs=2e-3)


def test_every_other_command_is_rejected_meanwhile(robot: Robot, guiding: HandGuiding) -> None:
    with guiding.guided():
        request = TrajectoryRequest(robot.joint_names, np.array([2.0]), np.full((1, 6), 0.1))
        commands: list[Callable[[], object]] = [
            lambda: robot.axes.move([Move(0, 0.1, Profile(0.5, 1.0, 1.0))]),
            lambda: robot.follower.follow(request).__enter__(),
            lambda: robot.stream(robot.joint_names, owner="leader").__enter__(),
            lambda: robot.axes.set_command_mode(0, 1),
            guiding.begin,
        ]
        for command in commands:
            with pytest.raises(NotReady, match=r"hand guiding|guided by hand"):
                command()
        robot.step(50)
        assert operations(robot) == {Operation.GUIDING}
        assert robot.image.position == pytest.approx([0.0] * 6, abs=1e-3)


def test_a_joint_that_moves_cannot_be_guided(robot: Robot, guiding: HandGuiding) -> None:
    robot.axes.move([Move(0, 0.5, Profile(0.5, 1.0, 1.0))])
    robot.step(20)
    with pytest.raises(NotReady, match="hand guiding needs an idle axis"):
        guiding.begin()
    with pytest.raises(NotReady, match="no joints are guided"):
        guiding.keep()


@pytest.mark.parametrize(
    ("end", "reason"),
    [
        (lambda robot: robot.axes.stop_latch.engage("a test"), "motion is stopped: a test"),
        (lambda robot: robot.pause(), "motion is paused"),
        (lambda robot: robot.axes.servo(1, False), "joint2: stopped, or servo off"),
        (lambda robot: robot.axes.stop([3]), "joint4: stopped, or servo off"),
        (lambda robot: robot.fault_injector.trip(2, 0x2310), "joint3: amplifier alarm"),
        (lambda robot: robot.fault_injector.move_by_hand(4, 0.4), "joint5 was moved at"),
        (lambda robot: robot.connection.stop_communication(), "joint1: stopped, or servo off"),
    ],
    ids=["latch", "pause", "servo off", "stop", "alarm", "too fast", "no communication"],
)  # fmt: skip
def test_what_ends_it(
    robot: Robot, guiding: HandGuiding, end: Callable[[Robot], None], reason: str
) -> None:
    guiding.begin()
    lead(robot, 0.1)
    end(robot)
    assert reason in ending(robot, guiding)
    left = robot.image.position.copy()
    robot.step(200)
    assert robot.image.position == pytest.approx(left, abs=2e-3, nan_ok=True)


def test_an_alarm_of_one_joint_leaves_the_others_held(robot: Robot, guiding: HandGuiding) -> None:
    guiding.begin()
    robot.fault_injector.trip(2, 0x2310)
    ending(robot, guiding)
    assert robot.image.servo_on.tolist() == [axis != 2 for axis in range(6)]
    with pytest.raises(OperationError, match="joints are off: joint3"):
        guiding.end()


def test_its_time_and_its_lease(robot: Robot, guiding: HandGuiding) -> None:
    guiding.begin(timeout_s=1.0)
    assert "its time of 1 s is over" in ending(robot, guiding)
    guiding.begin(lease_s=0.2)
    for _ in range(3):
        robot.step(90)  # 0.18 s
        guiding.keep()
    robot.step(110)
    with pytest.raises(NotReady, match=r"its client has been silent for 0\.2 s"):
        guiding.keep()
    rest(robot)
    assert robot.image.servo_on.all()


def test_a_speed_limit_of_ones_own(robot: Robot, guiding: HandGuiding) -> None:
    guiding.begin(max_speed=0.5)
    with suppress(RobotdError):  # once it is held, no hand moves it
        lead(robot, 0.3)
    assert "the limit is 0.5 rad/s" in ending(robot, guiding)


def test_a_stream_that_went_on_has_to_begin_anew(robot: Robot, guiding: HandGuiding) -> None:
    target = [0.2, 0.0, 0.0, 0.0, 0.0, 0.0]

    def send() -> None:
        with robot.stream(robot.joint_names, owner="leader", timeout_s=0.1) as stream:
            stream.send(target)
            robot.step(5)

    with guiding.guided():
        for _ in range(20):
            with pytest.raises(NotReady):
                send()
            robot.step(10)
    left = robot.image.position.copy()
    with pytest.raises(NotReady, match="kept commanding while motion was rejected"):
        send()
    assert robot.image.position == pytest.approx(left, abs=1e-3)
    robot.step(500)  # silence
    send()


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"max_speed": 0.0}, "max_speed is 0, must be 0.1 to 10"),
        ({"max_speed": float("nan")}, "max_speed"),
        ({"timeout_s": 1e9}, "timeout_s"),
        ({"lease_s": 0.0}, "lease_s is 0, must be 0.2 to 60"),
        ({"group": "legs"}, "joint group"),
    ],
)  # fmt: skip
def test_values_out_of_range(values: dict[str, object], reason: str) -> None:
    with (
        open_robot("cr3a", "sim", clock=SteppedClock()) as robot,
        pytest.raises(InvalidArgument, match=reason),
    ):
        robot.feature(HandGuiding).begin(**values)  # type: ignore[arg-type]


def test_one_arm_of_two_is_guided_while_the_other_works() -> None:
    with open_robot("dual_cr3a", "sim", clock=SteppedClock()) as robot:
        guiding = robot.feature(HandGuiding)
        with pytest.raises(InvalidArgument, match="name one of the joint groups"):
            guiding.begin()
        first, second = list(robot.groups.values())[:2]
        with guiding.guided(first.name):
            request = TrajectoryRequest(second.joint_names, np.array([1.0]), np.full((1, 6), 0.1))
            with second.follower.follow(request):
                robot.step(800)
            lead(robot, 0.1, first.joint_axes[0])
        assert robot.image.position[list(second.joint_axes)] == pytest.approx([0.1] * 6, abs=2e-3)
        assert robot.image.position[first.joint_axes[0]] == pytest.approx(0.1, abs=2e-3)


def test_an_arm_that_falls_is_guided_only_if_somebody_holds_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    falls = robotd_sim.CAPABILITIES | {Capability.FALLS_WHEN_GUIDED}
    monkeypatch.setattr(robotd_sim, "CAPABILITIES", falls)
    with open_robot("cr3a", "sim", clock=SteppedClock()) as robot:
        guiding = robot.feature(HandGuiding)
        with pytest.raises(NotReady, match=r"falls: hold it, and say so \(--held\)$"):
            guiding.begin()
        assert operations(robot) == {Operation.IDLE}
        with guiding.guided(held=True):
            assert operations(robot) == {Operation.GUIDING}


def test_a_backend_without_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    without = robotd_sim.CAPABILITIES - {Capability.HAND_GUIDING}
    monkeypatch.setattr(robotd_sim, "CAPABILITIES", without)
    with (
        open_robot("cr3a", "sim", clock=SteppedClock()) as robot,
        pytest.raises(Unsupported, match="hand guiding"),
    ):
        robot.feature(HandGuiding).begin()
