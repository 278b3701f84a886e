"""Recovery of a simulated arm: cause first, then every step that is needed, and no motion."""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np
import pytest
from tests.core.control.harness import Harness, arm

from robotd.control.groups.recovery import NOTHING_WRONG
from robotd.control.loop.setpoint_source import Outcome
from robotd.control.loop.watchdog import place_of
from robotd.device.process_image import ProcessImage
from robotd.device.state import ConnectionState
from robotd.errors import ConnectError, NotReady, RobotdError


def recover(harness: Harness) -> list[str]:
    """Return the report of a recovery in which no joint moves."""
    lines: list[str] = []
    position = harness.simulation.servo.position.copy()
    harness.robot.recover(lines.append)
    assert np.abs(harness.simulation.servo.position - position).max() < 1e-3
    assert harness.robot.problems == []
    assert harness.image.servo_on.all()
    return lines


def test_a_sound_robot_is_left_alone(harness: Harness) -> None:
    with harness.goal((1.0, 0.5, 0.0)) as execution:
        harness.run(0.3)
        lines: list[str] = []
        harness.robot.recover(lines.append)
        assert lines == [NOTHING_WRONG]
        harness.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED


def test_an_alarm_is_named_cleared_and_the_servo_switched_on(harness: Harness) -> None:
    with harness.goal((1.0, 0.5, 0.0)) as execution:
        harness.run(0.5)
        harness.faults.trip(1, 17)
        harness.end(execution)
    harness.run(1.0)
    found, cleared, on, verified = recover(harness)
    assert found.startswith("found: joint2: amplifier alarm 17")
    assert cleared == "alarms cleared: joint2"
    assert on == "servos on: joint2"
    assert verified.startswith("verified: 3 axes on, no alarm; largest change of position 0.00")
    with harness.goal((0.0, 0.0, 0.0)) as execution:
        assert harness.end(execution).outcome is Outcome.SUCCEEDED


def test_a_controllers_alarm_has_the_remedy_of_its_number(
    harness: Harness, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(harness.robot._problems, "_advise", lambda code: f"Turn {code}")
    harness.image.set_controller_alarm(17, "stuck")
    (problem,) = harness.robot.find_problems()
    assert problem.text == "controller alarm 17 (stuck)"
    assert (problem.code, problem.remedy) == (17, "Turn 17, then: robotd recover")


def test_servos_that_are_off_for_a_reason_say_it(harness: Harness) -> None:
    harness.robot.axes.servo(0, False)
    harness.robot.axes.servo(2, False)
    harness.image.reason[2] = "held by its button"
    assert harness.robot.problems == ["joint1: servo off", "joint3: servo off (held by its button)"]


def test_servos_that_are_off_are_switched_on(harness: Harness) -> None:
    harness.robot.axes.servo(2, False)
    assert harness.robot.problems == ["joint3: servo off"]
    assert recover(harness)[:2] == ["found: joint3: servo off", "servos on: joint3"]


@pytest.mark.parametrize("fault", ["drop_communication", "stop_engine"])
def test_a_lost_device_is_opened_as_far_as_needed(harness: Harness, fault: str) -> None:
    getattr(harness.faults, fault)()
    harness.run(0.1)
    lines = recover(harness)
    assert lines[0].startswith("found: engine is not ready (state ")
    assert lines[1] == "reconnecting"
    assert lines[2].startswith("reconnected after")
    assert lines[3] == "servos on: joint1, joint2, joint3"


def test_a_device_that_is_lost_while_it_is_recovered_is_opened_once_more(
    harness: Harness,
) -> None:
    """A drive told of the loss by an alarm, before the device did."""
    harness.faults.trip(1, 17)
    harness.run(0.1)
    driver = harness.robot.axes._driver
    clear = driver.clear_alarm

    def lose(axis: int, timeout_s: float) -> None:
        driver.clear_alarm = clear  # type: ignore[method-assign]
        harness.faults.drop_communication()
        raise NotReady("no frame came back", axis=axis)

    driver.clear_alarm = lose  # type: ignore[method-assign]
    lines = recover(harness)
    assert lines[1].startswith("lost meanwhile: ")
    assert lines[2] == "reconnecting"
    assert lines[-1].startswith("verified: 3 axes on, no alarm")


def test_a_device_without_fresh_values_is_closed_and_opened(harness: Harness) -> None:
    harness.faults.freeze(True)
    harness.run(0.3)
    close = harness.connection.close

    def closed() -> None:
        close()
        harness.faults.freeze(False)

    harness.connection.close = closed  # type: ignore[method-assign]
    lines = recover(harness)
    assert "found: engine is not ready (state Unknown): " in lines[0]
    assert lines[2].startswith("no fresh values (")


def test_a_drive_that_is_offline_joins_the_bus(harness: Harness) -> None:
    harness.faults.disconnect(1)
    harness.run(0.3)
    harness.faults.reconnect(1)
    lines = recover(harness)
    assert lines[0].startswith("found: joint2: drive is offline")
    assert lines[1] == "connecting again: joint2"


def test_an_alarm_that_stays_ends_it_and_no_servo_is_switched_on(harness: Harness) -> None:
    harness.faults.trip(1, 17)
    harness.run(0.5)
    harness.robot.axes.servo(2, False)
    clear = harness.robot.axes._driver.clear_alarm

    def refuse(axis: int, timeout_s: float) -> None:
        raise NotReady("the alarm comes back: the brake is worn")

    harness.robot.axes._driver.clear_alarm = refuse  # type: ignore[method-assign]
    lines: list[str] = []
    with pytest.raises(ConnectError, match=r"joint2: .*the brake is worn"):
        harness.robot.recover(lines.append)
    assert len(lines) == 2  # the alarm and the servo that is off
    assert not harness.image.servo_on[2]
    harness.robot.axes._driver.clear_alarm = clear  # type: ignore[method-assign]
    recover(harness)


def test_joints_that_a_source_still_holds_are_named(harness: Harness) -> None:
    with harness.robot.axes.claimed("a test", [1]):
        harness.faults.trip(1, 17)
        harness.run(0.5)
        with pytest.raises(NotReady, match="joint2: in use by a test"):
            harness.robot.recover()


def test_a_device_that_cannot_be_opened_ends_it(harness: Harness) -> None:
    harness.faults.stop_engine()
    harness.simulation.failures_left = 1
    harness.run(0.1)
    lines: list[str] = []
    with pytest.raises(ConnectError, match="cannot be opened"):
        harness.robot.recover(lines.append)
    assert lines[-1] == "reconnecting"
    recover(harness)


def goes_off(harness: Harness, axis: int, times: int, code: int = 0) -> None:
    """Let ``axis`` go off half a second after it was switched on, ``times`` times."""
    off_ns: list[int] = []
    servo = harness.robot.axes._driver.servo
    left = times

    def switched(number: int, on: bool, timeout_s: float) -> None:
        nonlocal left
        servo(number, on, timeout_s)
        if number == axis and on and left:
            left -= 1
            off_ns.append(harness.clock.now_ns() + 500_000_000)

    def fall(image: ProcessImage) -> None:
        if off_ns and image.stamp_ns >= off_ns[0]:
            off_ns.clear()
            if code:
                harness.faults.trip(axis, code)
            else:
                servo(axis, False, 1.0)

    harness.robot.axes._driver.servo = switched  # type: ignore[method-assign]
    harness.robot.control_loop.every(1000, "fall", fall)


def test_a_servo_that_goes_off_again_is_switched_on_once_more(harness: Harness) -> None:
    harness.robot.axes.servo(2, False)
    goes_off(harness, 2, times=1)
    lines = recover(harness)
    assert lines[1:4] == [
        "servos on: joint3",
        "not stable yet: joint3: servo off",
        "servos on: joint3",
    ]
    assert lines[-1].startswith("verified: 3 axes on")


def test_a_servo_that_does_not_stay_on_is_not_verified(harness: Harness) -> None:
    harness.robot.axes.servo(2, False)
    goes_off(harness, 2, times=2)
    lines: list[str] = []
    with pytest.raises(NotReady, match="not recovered: joint3: servo off"):
        harness.robot.recover(lines.append)
    assert not any("verified" in line for line in lines)


def test_a_drive_that_trips_again_is_not_switched_on_twice(harness: Harness) -> None:
    harness.robot.axes.servo(2, False)
    goes_off(harness, 2, times=1, code=17)
    lines: list[str] = []
    with pytest.raises(NotReady, match="not recovered: joint3: amplifier alarm 17"):
        harness.robot.recover(lines.append)
    assert lines[1:] == ["servos on: joint3"]


def test_values_from_before_the_last_command_verify_nothing(harness: Harness) -> None:
    harness.robot.axes.servo(2, False)
    fresh_ns, read = harness.image.fresh_ns, harness.robot.axes._driver.read

    def old(image: ProcessImage) -> None:
        read(image)
        image.fresh_ns = fresh_ns + int(harness.image.servo_on[2])  # of the command, no newer one

    harness.robot.axes._driver.read = old  # type: ignore[method-assign]
    with pytest.raises(RobotdError):
        harness.robot.recover()


def test_one_recovery_at_a_time(harness: Harness) -> None:
    harness.robot.axes.servo(2, False)
    errors: list[RobotdError] = []

    def again(line: str) -> None:
        with pytest.raises(NotReady, match="another recovery is running") as caught:
            harness.robot.recover()
        errors.append(caught.value)

    harness.robot.recover(again)
    assert errors


def test_a_robot_that_shuts_down_is_not_recovered(harness: Harness) -> None:
    harness.robot.shutdown()
    with pytest.raises(NotReady, match="being shut down"):
        harness.robot.recover()


def reconnecting(**keys: Any) -> Harness:
    harness = Harness(arm(engine={"open_retry_s": 0.0, "open_tries": 1, "reconnect": True, **keys}))
    # Attempts come from the test: a thread would advance the stepped clock.
    harness.robot._reconnector.start = lambda: None  # type: ignore[method-assign]
    return harness


def test_a_lost_device_is_reconnected_with_its_servos_off() -> None:
    harness = reconnecting().up()
    harness.faults.stop_engine()
    harness.simulation.failures_left = 2
    harness.run(0.1)
    assert harness.connection.lost
    for _ in range(2):
        harness.robot._reconnector.attempt()
        assert not harness.connection.ready
    harness.robot._reconnector.attempt()
    harness.run(0.1)
    assert harness.connection.ready
    assert not harness.connection.lost
    assert not harness.image.servo_on.any()


def test_a_device_that_ended_is_opened_again_until_that_works() -> None:
    harness = reconnecting().up()
    harness.simulation.engine = ConnectionState.SHUTDOWN
    harness.simulation.failures_left = 2
    harness.run(0.1)
    for _ in range(3):
        assert harness.connection.lost
        harness.robot._reconnector.attempt()
    assert harness.connection.ready


def test_a_device_that_comes_late_is_connected() -> None:
    harness = reconnecting()
    harness.simulation.failures_left = 2
    with pytest.raises(ConnectError):
        harness.up()
    harness.robot._reconnector.attempt()
    assert not harness.connection.ready
    harness.robot._reconnector.attempt()
    assert harness.connection.ready
    assert not harness.image.servo_on.any()


def test_what_was_stopped_on_purpose_stays_stopped() -> None:
    harness = reconnecting().up()
    harness.connection.stop_communication()
    harness.robot._reconnector.attempt()
    assert harness.connection.state is ConnectionState.RUNNING
    harness.connection.close()
    harness.robot._reconnector.attempt()
    assert harness.connection.state is ConnectionState.IDLE


@pytest.mark.parametrize("command", ["stop_communication", "close"])
def test_what_is_being_stopped_on_purpose_is_not_reconnected(command: str) -> None:
    harness = reconnecting().up()
    driver, attempt = harness.connection._driver, harness.robot._reconnector.attempt
    stop, attempts = driver.stop_communication, []

    def slow(timeout_s: float) -> None:
        stop(timeout_s)
        harness.run(0.1)
        assert harness.connection.lost, "until the command has ended"
        attempts.append(threading.Thread(target=attempt))
        attempts[0].start()
        wait_for_waiting(attempts[0], "restore")

    driver.stop_communication = slow  # type: ignore[method-assign]
    getattr(harness.connection, command)()
    attempts[0].join(10.0)
    assert harness.connection.state in (ConnectionState.RUNNING, ConnectionState.IDLE)


def wait_for_waiting(thread: threading.Thread, function: str) -> None:
    """Wait until ``thread`` has called a function whose name begins so."""
    end_s = time.monotonic() + 10.0
    while function not in place_of(thread):
        assert time.monotonic() < end_s
        time.sleep(1e-3)


def test_a_robot_that_shuts_down_is_not_reconnected() -> None:
    harness = reconnecting().up()
    harness.faults.stop_engine()
    harness.run(0.1)
    harness.connection.abort_start()
    harness.robot._reconnector.attempt()
    assert not harness.connection.ready


def test_the_thread_reconnects_and_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    harness = Harness(arm(engine={"open_retry_s": 0.0, "reconnect": True}))
    attempted = threading.Event()
    monkeypatch.setattr(harness.robot._reconnector, "attempt", attempted.set)
    harness.up()
    assert attempted.wait(10.0)
    harness.robot.shutdown()
    assert "robotd-reconnect" not in [thread.name for thread in threading.enumerate()]
