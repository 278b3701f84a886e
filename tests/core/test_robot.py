"""A whole robot on the simulation: brought up, recovered, restarted and shut down."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import pytest
from structlog.testing import capture_logs
from tests.core.control.harness import Harness, arm

from robotd.call_timeout import end_idle_threads
from robotd.clock import MonotonicClock
from robotd.clock.simulated import PacedClock
from robotd.control.loop.setpoint_source import Outcome
from robotd.device.axes import Jog
from robotd.device.state import CommandMode, ConnectionState
from robotd.errors import ConnectError, NotReady, OperationError, RobotdError
from robotd.motion import TrajectoryRequest
from robotd.motion.profile import Profile
from robotd.plugin.manager import load_backend
from robotd.robot import Robot, build_robot, open_robot

FAR = (1.0, -0.6, 0.3)


@pytest.fixture
def harness() -> Harness:
    return Harness()


def make(**keys: Any) -> Robot:
    return Robot(arm(**keys), load_backend("sim"), MonotonicClock())


@pytest.fixture
def threads() -> Iterator[None]:
    """No thread is left behind."""
    before = set(threading.enumerate())
    yield
    left = [
        thread for thread in threading.enumerate() if thread not in before and thread.is_alive()
    ]
    assert left == []


def test_start_switches_the_joints_on(harness: Harness) -> None:
    harness.robot.start()
    assert harness.connection.ready
    assert harness.image.servo_on.all()


def test_start_may_leave_the_servos_alone(harness: Harness) -> None:
    harness.robot.start(enable=False)
    harness.run(0.01)
    assert harness.connection.ready
    assert not harness.image.servo_on.any()


def test_a_failed_start_can_be_repeated(harness: Harness) -> None:
    harness.simulation.failures_left = 7
    with pytest.raises(ConnectError, match="cannot be opened"):
        harness.robot.start()  # five tries
    harness.robot.start()
    assert harness.image.servo_on.all()


def test_enabling_again_has_no_effect_on_what_is_on(harness: Harness) -> None:
    harness.up().robot.servos.enable()
    assert harness.image.servo_on.all()


def test_shutdown_brings_a_trajectory_to_rest_then_servos_off_then_closes(harness: Harness) -> None:
    harness.up()
    with harness.goal(FAR) as execution:
        harness.run(0.4)
        harness.robot.shutdown()
        assert execution.outcome is Outcome.CANCELED
    harness.setpoints.assert_smooth(12.0)
    assert not harness.simulation.states.servo_on.any()
    assert harness.connection.state is ConnectionState.SHUTDOWN
    assert not harness.connection.ready


def test_shutdown_brings_a_move_to_rest(harness: Harness) -> None:
    harness.up()
    harness.move(0, 2.0)
    harness.run(0.5)
    speeds: list[float] = []
    harness.robot.control_loop.every(
        500.0, "speed", lambda image: speeds.append(float(image.velocity[0]))
    )
    harness.robot.shutdown()
    steps = np.abs(np.diff(speeds))
    assert speeds[0] > 0.5
    assert steps.max() < 5.0 * 0.002 * 1.5, "braked with the move's own deceleration"
    assert abs(speeds[-1]) < 0.02


def test_shutdown_ends_a_jog_with_a_ramp_that_takes_for_ever_by_a_quick_stop() -> None:
    harness, axis = (
        Harness(arm(axes=4)).up(),
        3,
    )  # one without limits: others are rejected such a ramp
    harness.robot.axes.servo(axis, True)
    harness.robot.axes.set_command_mode(axis, CommandMode.VELOCITY)
    harness.robot.axes.jog([Jog(axis, Profile(1.0, 5.0, 1e-6))])
    harness.run(0.5)
    assert harness.image.velocity[axis] > 0.5
    powered: list[float] = []
    servo = harness.robot.axes._driver.servo

    def noted(number: int, on: bool, timeout_s: float) -> None:
        powered.append(abs(harness.image.velocity[axis]))
        servo(number, on, timeout_s)

    harness.robot.axes._driver.servo = noted  # type: ignore[method-assign]
    harness.robot.shutdown()
    assert powered
    assert max(powered) < 0.1, "it moved when its servo was switched off"


def test_a_move_that_the_image_does_not_show_yet_is_stopped_too(harness: Harness) -> None:
    harness.up()
    harness.run(0.1)
    harness.move(0, 2.0)
    harness.robot.shutdown()
    assert not harness.simulation.world.moves(0)
    assert abs(harness.simulation.servo.position[0]) < 0.1


def test_no_motion_begins_while_communication_is_stopped(harness: Harness) -> None:
    """A client goes on sending goals; its joints must stand when their servos go off."""
    rest, rejections = harness.up().robot.axes.stop_and_wait, []

    def resting(axes: Sequence[int], timeout_s: float) -> None:
        rest(axes, timeout_s)
        with pytest.raises(NotReady) as caught, harness.goal(FAR):
            pass
        rejections.append(str(caught.value))

    harness.robot.axes.stop_and_wait = resting  # type: ignore[assignment,method-assign]
    harness.connection.stop_communication()
    assert rejections == ["communication is being stopped: nothing is started any more"]
    harness.robot.recover()
    with harness.goal(FAR) as execution:
        assert harness.end(execution).outcome is Outcome.SUCCEEDED


def test_shutdown_twice_and_before_start_is_fine() -> None:
    robot = make()
    robot.shutdown()
    robot.shutdown()
    with pytest.raises(NotReady, match="shut down"):
        robot.start()


@pytest.mark.usefixtures("threads")
def test_a_start_after_a_shutdown_or_overtaken_by_one_leaves_no_thread() -> None:
    robot = make()
    require_alive, overtaking = robot.connection.require_alive, [robot.shutdown]

    def overtaken() -> None:
        require_alive()
        while overtaking:
            overtaking.pop()()

    robot.connection.require_alive = overtaken  # type: ignore[method-assign]
    for _ in range(2):
        with pytest.raises(NotReady, match="shut down"):
            robot.start()
    end_idle_threads()
    for thread in threading.enumerate():
        if thread.name in ("robotd-axis-stops", "robotd-control", "robotd-watchdog"):
            thread.join(10.0)


@pytest.mark.usefixtures("threads")
def test_open_robot_leaves_nothing_behind() -> None:
    with open_robot("cr3a", "sim") as robot:
        assert robot.connection.ready
        assert robot.image.servo_on.all()
    assert robot.connection.state is ConnectionState.SHUTDOWN


@pytest.mark.usefixtures("threads")
def test_an_exception_in_the_block_shuts_down() -> None:
    with pytest.raises(ZeroDivisionError), open_robot("cr3a", "sim") as robot:
        raise ZeroDivisionError
    assert robot.connection.state is ConnectionState.SHUTDOWN


def test_a_failing_stop_is_logged_and_the_rest_is_done_all_the_same(harness: Harness) -> None:
    harness.up()
    driver = harness.robot.axes._driver

    def fail(*arguments: object) -> None:
        raise OperationError("bus off")

    driver.stop = fail  # type: ignore[method-assign]
    with capture_logs() as logs:
        harness.robot.shutdown()
    failures = [line for line in logs if line["log_level"] == "error"]
    assert [(line["event"], line["reason"]) for line in failures] == [
        ("stopping the axes failed; it is repeated", "bus off")
    ]
    assert not harness.simulation.states.servo_on.any()
    assert harness.connection.state is ConnectionState.SHUTDOWN


@pytest.mark.usefixtures("threads")
def test_what_fails_in_a_shutdown_keeps_no_other_step_from_being_done(harness: Harness) -> None:
    harness.up()
    robot = harness.robot

    def fail(what: str) -> Callable[..., None]:
        def raising(*_: object) -> None:
            raise RuntimeError(what)

        return raising

    robot.servos.disable = fail("first")  # type: ignore[method-assign]
    robot.connection.before_stop = robot.servos.disable
    robot.connection._driver.close = fail("second")  # type: ignore[method-assign]
    robot.axes.stops.close = fail("third")  # type: ignore[method-assign]
    with capture_logs() as logs, pytest.raises(RuntimeError, match="first"):
        robot.shutdown()
    failures = [str(line["exc_info"]) for line in logs if "clean-up failed" in line["event"]]
    assert failures == ["second", "third"]
    assert harness.connection.state is ConnectionState.SHUTDOWN
    assert any("not confirmed to be off" in line["event"] for line in logs)


def test_an_error_of_the_block_goes_before_one_of_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(robot: Robot) -> None:
        shutdown(robot)
        raise RuntimeError("in the end")

    shutdown = Robot.shutdown
    monkeypatch.setattr(Robot, "shutdown", fail)
    with pytest.raises(NotReady, match="first"), open_robot("scara", backend="sim"):
        raise NotReady("first")
    with pytest.raises(RuntimeError, match="in the end"), open_robot("scara", backend="sim"):
        pass


def test_a_servo_off_is_final_for_an_earlier_request_to_switch_on(harness: Harness) -> None:
    harness.robot.start(enable=False)
    axes = harness.robot.axes
    offs = axes.servo_offs
    axes.servo(0, False)
    with pytest.raises(NotReady, match="its servo was switched off meanwhile"):
        axes.servo(0, True, offs=offs)
    assert not harness.simulation.states.servo_on.any()
    axes.servo(1, True, offs=offs)
    assert harness.simulation.states.servo_on[1]


def test_all_servos_off_is_final_for_one_that_is_not_on_yet(harness: Harness) -> None:
    harness.robot.start(enable=False)
    offs = harness.robot.axes.servo_offs
    harness.robot.servos.disable()
    with pytest.raises(NotReady, match="its servo was switched off meanwhile"):
        harness.robot.axes.servo(0, True, offs=offs)
    assert not harness.simulation.states.servo_on.any()


def test_simulated_time_is_not_paused_in_a_shutdown() -> None:
    """A client of the simulation goes on stepping it."""
    clock = PacedClock()
    robot = Robot(arm(), load_backend("sim"), clock)
    robot.start()
    disable = robot.connection.before_stop

    def step_and_disable() -> None:
        clock.step(1, 10.0)
        clock.pause()
        disable()

    robot.connection.before_stop = step_and_disable
    ending = threading.Thread(target=robot.shutdown)
    ending.start()
    ending.join(10.0)
    ended = not ending.is_alive()
    clock.resume()
    assert ended


def test_shutdown_ends_a_start_that_waits_for_the_device() -> None:
    keys = {"backends": {"sim": {"fail_open": 1000}}}
    robot = make(**keys, engine={"open_tries": 1000, "open_retry_s": 3600.0})
    tried = threading.Event()
    device: Any = robot.connection._driver
    open_device = device.open

    def opened(path: str = "", name: str = "") -> None:
        tried.set()
        open_device(path, name)

    device.open = opened
    starting = threading.Thread(target=robot.start)
    starting.start()
    assert tried.wait(10.0)
    robot.shutdown()
    starting.join(10.0)
    assert not starting.is_alive()
    assert robot.connection.state is ConnectionState.SHUTDOWN


@pytest.mark.usefixtures("threads")
def test_shutdown_during_the_start_of_communication_waits_and_closes() -> None:
    robot = make(backends={"sim": {"communication_delay_s": 0.3}})
    errors: list[RobotdError] = []  # what a start says then depends on how far it was

    def start() -> None:
        try:
            robot.start()
        except RobotdError as error:
            errors.append(error)

    starting = threading.Thread(target=start)
    starting.start()
    device: Any = robot.connection._driver
    while device.state() is ConnectionState.IDLE:
        pass
    robot.shutdown()
    starting.join(10.0)
    assert not starting.is_alive()
    assert robot.connection.state is ConnectionState.SHUTDOWN
    assert device.wrapped.simulation.engine is ConnectionState.IDLE
    assert not device.wrapped.simulation.states.servo_on.any()


def test_nothing_is_switched_on_after_a_request_to_end(harness: Harness) -> None:
    device: Any = harness.robot.connection._driver
    start = device.start_communication

    def interrupted(timeout_s: float) -> None:
        start(timeout_s)
        harness.robot.connection.abort_start()

    device.start_communication = interrupted
    with pytest.raises(NotReady, match="being shut down"):
        harness.robot.start()
    harness.run(0.1)
    assert not harness.simulation.states.servo_on.any()
    assert harness.connection.state is ConnectionState.RUNNING


def test_a_request_to_end_between_two_servos_leaves_the_second_off(harness: Harness) -> None:
    harness.robot.start(enable=False)
    requested: list[tuple[int, bool]] = []
    driver: Any = harness.robot.axes._driver
    servo = driver.servo

    def interrupted(axis: int, on: bool, timeout_s: float) -> None:
        requested.append((axis, on))
        servo(axis, on, timeout_s)
        harness.robot.connection.abort_start()

    driver.servo = interrupted
    with pytest.raises(ConnectError, match="being shut down"):
        harness.robot.servos.enable()
    assert requested == [(0, True), (0, False)]
    assert not harness.simulation.states.servo_on.any()


def test_a_servo_that_enables_when_its_robot_is_deactivated_goes_off(harness: Harness) -> None:
    harness.robot.start(enable=False)
    driver: Any = harness.robot.axes._driver
    servo, latch = driver.servo, harness.robot.axes.stop_latch

    def interrupted(axis: int, on: bool, timeout_s: float) -> None:
        servo(axis, on, timeout_s)
        latch.inactive, latch.servos_allowed = "inactive", False

    driver.servo = interrupted
    with pytest.raises(NotReady, match="the robot is inactive"):
        harness.robot.axes.servo(0, True)
    assert not harness.simulation.states.servo_on.any()


def test_disabling_sees_a_servo_that_has_just_gone_on(harness: Harness) -> None:
    harness.robot.start(enable=False)
    harness.clock.detach()  # no period of the control loop: the image does not show it yet
    harness.robot.axes._driver.servo(0, True, 1.0)
    harness.clock.attach(harness.robot.control_loop.period_ns, harness.robot.control_loop.period)
    assert not harness.image.servo_on[0]
    harness.robot.servos.disable()
    assert not harness.simulation.states.servo_on.any()


def test_disabling_in_a_stall_switches_off_what_no_image_shows(harness: Harness) -> None:
    harness.robot.start(enable=False)
    harness.clock.detach()  # no period of the control loop until the end
    harness.robot.axes.servo(0, True)
    assert not harness.image.servo_on[0]
    harness.robot.servos.disable()
    assert not harness.simulation.states.servo_on.any()


def test_no_motion_starts_after_a_request_to_end(harness: Harness) -> None:
    harness.up()
    harness.robot.connection.abort_start()
    with pytest.raises(NotReady, match="being shut down"):
        harness.move(0, 1.0)
    with pytest.raises(NotReady, match="being shut down"):
        harness.goal(FAR).__enter__()


def test_nobody_is_ready_before_the_parameters_are_in_force() -> None:
    robot = build_robot("cr3a", "sim")
    device: Any = robot.connection._driver
    load, ready = device.load_parameters, list[bool]()

    def slow(path: Any) -> None:
        for _ in range(20):
            robot.control_loop.step(robot.clock.now_ns())
            ready.append(robot.connection.ready)
        load(path)

    device.load_parameters = slow
    robot.connection.start()
    assert ready == [False] * 20
    assert robot.connection.ready
    robot.shutdown()


def test_a_goal_in_the_real_cycle_thread() -> None:
    robot = make()
    robot.start()
    try:
        request = TrajectoryRequest.from_rows(robot.joint_names, [0.3], [[0.1, -0.1, 0.05]])
        with robot.follower.follow(request) as execution:
            assert execution.wait(10.0)
        assert execution.outcome is Outcome.SUCCEEDED
        assert robot.image.position == pytest.approx([0.1, -0.1, 0.05], abs=1e-3)
    finally:
        robot.shutdown()
