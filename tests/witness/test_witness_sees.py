"""What a faulty master does is seen at the drive: each fault here is put into robotd by a patch."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import pytest
from tests.witness.backends import BENCHES
from tests.witness.bench import Bench
from tests.witness.canopen_bench import CanopenBench
from tests.witness.dobot_bench import DobotBench
from tests.witness.ethercat_bench import EthercatBench
from tests.witness.judge import KEPT_COMMANDS
from tests.witness.servo_bench import ServoBench

from robotd.control.sources.wheel_source import WheelMotion
from robotd.device.axes import Jog
from robotd.device.process_image import ProcessImage
from robotd.device.profiled_axes import _AxisMotion
from robotd.errors import RobotdError
from robotd.motion import TrajectoryRequest
from robotd.motion.planar import PlanarTwist
from robotd.motion.profile import Profile
from robotd_canopen.bus import Bus
from robotd_cia402.axis import Axis
from robotd_ethercat.soem import Soem
from robotd_franka.arm_link import MISSING_S, SILENT_S, ArmLink
from robotd_franka.axes import FrankaAxes
from robotd_serial_servo import switching
from robotd_serial_servo.servo_bus import Goal
from robotd_serial_servo.servo_record import ServoRecord

FIELDBUSES = ("canopen", "ethercat")
SERVOS = ("feetech", "dynamixel")
send_targets = FrankaAxes.send_targets
LOAD_NM = 0.8
EVERY = (*FIELDBUSES, "sim", "arm", "dobot", "franka", "wmx", *SERVOS)


@pytest.fixture(params=EVERY)
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    yield from started(request.param)


@pytest.fixture(params=FIELDBUSES)
def fieldbus(request: pytest.FixtureRequest) -> Iterator[Bench]:
    yield from started(request.param)


@pytest.fixture(params=SERVOS)
def servos(request: pytest.FixtureRequest) -> Iterator[Bench]:
    yield from started(request.param)


@pytest.fixture
def franka() -> Iterator[Bench]:
    yield from started("franka")


@pytest.fixture
def wmx(request: pytest.FixtureRequest) -> Iterator[Bench]:
    yield from started("wmx", **getattr(request, "param", {}))


def started(name: str, **options: float) -> Iterator[Bench]:
    if name.startswith("wmx"):
        pytest.importorskip("nanobind", reason="make -C plugins/wmx tools")
    made = BENCHES[name](rate_hz=100.0, **options)
    with made.requested():
        made.robot.start()
    yield made
    made.robot.shutdown()
    made.close()


def move(bench: Bench, *, at_half: Callable[[], None] = lambda: None) -> None:
    """Move by 0.5 rad in a second, with something in its midst."""
    middle = bench.middle or [0.0] * len(bench.judges)
    seconds = 1.0 + bench.seconds_per_rad - Bench.seconds_per_rad  # longer for weaker arms
    targets = [[place + 0.5 for place in middle]]
    request = TrajectoryRequest.from_rows(bench.robot.joint_names, [seconds], targets)
    with bench.robot.follower.follow(request) as execution:
        bench.run(seconds / 2)
        at_half()
        for _ in range(200):
            if execution.done:
                return
            bench.run(0.01)


def test_a_plain_path_is_right(bench: Bench) -> None:
    move(bench)
    assert bench.findings == []
    assert all(len(judge.commands) == KEPT_COMMANDS for judge in bench.judges)


def test_a_target_that_jumps(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    driver, stream = bench.robot.mixer._driver, bench.robot.mixer._driver.stream

    def jump() -> None:
        def faulty(position: object, velocity: object, due_ns: int) -> None:
            monkeypatch.setattr(driver, "stream", stream)
            stream(position + 0.1, velocity, due_ns)  # type: ignore[operator, arg-type]

        monkeypatch.setattr(driver, "stream", faulty)

    move(bench, at_half=jump)
    # Goals of servos follow it with no more than the speed of the joint.
    what = "target changes by" if isinstance(bench, ServoBench) else "in a period: +1"
    assert any(what in finding for finding in bench.findings)


def test_a_path_that_does_not_wait_for_a_silent_drive(fieldbus: Bench) -> None:
    """A silence of one period cannot be bridged by waiting: the path has gone on by then."""
    fieldbus.judges[0].velocity = 0.5  # as if the joint were slower than the path
    move(fieldbus, at_half=lambda: fieldbus.silence(0.025, [0]))
    assert any("after a silence" in finding for finding in fieldbus.findings)


def test_a_drive_that_is_switched_on_by_itself(fieldbus: Bench) -> None:
    fieldbus.robot.servos.disable()
    fieldbus.run(0.1)
    assert fieldbus.findings == []
    fieldbus.robot.servos.enable()  # by nobody's request, for the judges
    assert any("without a request" in finding for finding in fieldbus.findings)


def test_frames_of_a_blocked_bus_that_are_executed_late(monkeypatch: pytest.MonkeyPatch) -> None:
    """As before unsent frames were discarded."""
    monkeypatch.setattr(Bus, "discard_unsent", lambda _: None)
    made = CanopenBench(rate_hz=100.0)
    with made.requested():
        made.robot.start()
    move(made, at_half=lambda: made.block(0.08))
    made.robot.shutdown()
    assert any("periods ago" in finding for finding in made.findings)


def test_frames_of_a_blocked_interface_that_are_executed_late(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As before nothing was sent while an interface is blocked."""
    monkeypatch.setattr(Soem, "is_blocked", False)
    made = EthercatBench(rate_hz=100.0)
    with made.requested():
        made.robot.start()
    move(made, at_half=lambda: made.block(0.06))
    made.robot.shutdown()
    made.close()
    assert any("periods ago" in finding for finding in made.findings)


def test_targets_that_a_controller_gets_late() -> None:
    """As with a time without replies that is too long."""
    made = DobotBench(max_target_age_s=1.0)
    with made.requested():
        made.robot.start()
    move(made, at_half=lambda: made.cut_cable(0.09))
    made.robot.shutdown()
    made.close()
    assert any("periods ago" in finding for finding in made.findings)


@pytest.mark.parametrize("wmx", [{"stream_buffer_s": 0.1}], indirect=True)
def test_commands_that_wait_in_the_engine(wmx: Bench) -> None:
    """As with more commands ahead than the robot's file says."""
    move(wmx)
    assert any("periods ago" in finding for finding in wmx.findings)


def test_a_buffer_that_is_ended_in_motion(wmx: Bench) -> None:
    """As in a stop without its ramp."""
    positions = vars(wmx.robot.axes._driver)["wrapped"]._positions
    move(wmx, at_half=positions.close)
    assert any("has no command" in finding for finding in wmx.findings)


def test_a_ramp_of_the_sender_that_is_too_hard(wmx: Bench) -> None:
    """As with the acceleration limit in another unit."""
    positions = vars(wmx.robot.axes._driver)["wrapped"]._positions
    scaling = positions._connection.scaling
    scaling.stop_deceleration = 10.0 * scaling.stop_deceleration
    positions.close()  # it is bound anew
    move(wmx, at_half=lambda: positions.stop([0]))
    assert any("velocity of the target changes" in finding for finding in wmx.findings)


@pytest.mark.parametrize("name", ["canopen-base", "wmx-base"])
def test_wheels_that_move_by_themselves(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As without the time-out of commands, and after a stop."""
    for made in started(name):
        monkeypatch.setattr(WheelMotion, "advance", go_on_driving)
        drive_and_stop(made)


def drive_and_stop(made: Bench) -> None:
    base, wheel = made.robot.base, made.judges[1]
    assert base is not None
    base.command(0.3, 0.0, timeout_s=0.1)
    wheel.rest_s = made.now_s + 1.0
    made.run(0.9)
    assert made.findings == []
    made.run(0.2)
    assert any("nobody commands it" in finding for finding in made.findings)
    wheel.must_rest = True
    made.run(0.1)
    assert any("after a stop" in finding for finding in wheel.findings)


def test_a_velocity_that_jumps() -> None:
    for made in started("wmx-base"):
        drive_with_a_jump(made)


def drive_with_a_jump(made: Bench) -> None:
    base = made.robot.base
    assert base is not None
    base.command(0.3, 0.0, timeout_s=1.0)
    made.run(0.5)
    assert made.findings == []
    stream = vars(made.robot.axes._driver)["wrapped"]._stream
    put = stream.put
    stream.put = lambda velocity: put(velocity + 3.0)
    made.run(0.05)
    assert any("target goes from" in finding for finding in made.findings)


def go_on_driving(motion: WheelMotion, time_ns: int, period_ns: int, image: ProcessImage) -> bool:
    motion._set_wheels(motion._limiter.step(PlanarTwist(0.3, 0.0)))
    return not motion.completion.done


def test_a_stop_that_lets_the_drives_go_on(
    fieldbus: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def go_on(axis: Axis, period_s: float, periods: int = 1) -> None:  # type: ignore[type-arg]
        axis.setpoint.position += 0.002
        transmit(axis, period_s, periods)

    transmit = Axis.transmit
    move(fieldbus)
    fieldbus.robot.stop()
    for judge in fieldbus.judges:
        judge.must_rest = True
    fieldbus.run(0.1)
    assert fieldbus.findings == []
    monkeypatch.setattr(Axis, "transmit", go_on)
    fieldbus.run(0.1)
    assert any("after a stop" in finding for finding in fieldbus.findings)


def jog(bench: Bench) -> None:
    """Let all joints move at 1 rad/s."""
    how = bench.profile
    for axis in range(bench.joints):
        bench.robot.axes.set_command_mode(axis, 1)
    ramps = how.acceleration, how.deceleration
    bench.robot.axes.jog([Jog(axis, Profile(1.0, *ramps)) for axis in range(bench.joints)])
    bench.run(1.0 / how.acceleration + 0.3)
    assert bench.findings == []


@pytest.mark.parametrize("missing_s", [MISSING_S, SILENT_S])
def test_a_path_that_goes_on_while_no_state_comes(missing_s: float, franka: Bench) -> None:
    """As before a silence counted that is too short to end a motion of the arm."""
    vars(franka.robot.connection._driver)["wrapped"].link._missing_s = missing_s
    franka.judges[0].velocity = 0.35  # the path has 0.4
    move(franka, at_half=lambda: franka.silence(0.02))
    found = any("after a silence" in finding for finding in franka.findings)
    assert found == (missing_s != MISSING_S)


def test_a_controller_that_keeps_a_velocity_while_the_control_loop_is_suspended(
    franka: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    jog(franka)
    franka.stall(0.1)
    assert franka.findings == []
    monkeypatch.setattr(ArmLink, "_hold", lambda _: None)
    franka.run(0.3)
    franka.stall(0.1)
    assert any("s ago" in finding for finding in franka.findings)


@pytest.mark.parametrize("brakes", [True, False])
def test_a_guided_joint_that_is_not_braked_where_it_is_caught(
    *, brakes: bool, franka: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As when its target had the velocity of the joint."""
    if not brakes:
        monkeypatch.setattr(FrankaAxes, "send_targets", send_with_velocities)
    group = franka.robot.axes.servo_group(0)
    for axis in group:
        franka.judges[axis].may_catch = True
    franka.robot.axes.begin_guiding(group)
    franka.push(0, 0.6)
    franka.run(0.5)
    franka.robot.axes.stop(group)
    caught = float(franka.robot.image.position[0])
    franka.run(0.5)
    travel = abs(franka.robot.image.position[0] - caught)
    assert (travel < 0.05) == brakes, travel
    assert any("is led on" in finding for finding in franka.findings) != brakes


def send_with_velocities(axes: FrankaAxes, positions: Any) -> None:
    guided, axes._let_go = axes._let_go, frozenset()
    try:
        send_targets(axes, positions)
    finally:
        axes._let_go = guided


def test_a_goal_that_is_sent_to_a_servo_that_was_switched_off(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of STS servos a goal switches the torque on."""
    for made in started("feetech"):
        made.run(0.1)
        monkeypatch.setattr(ServoRecord, "deactivate", lambda _: None)
        made.robot.servos.disable()
        made.run(0.1)
        assert any("without a request" in finding for finding in made.findings)


def test_a_servo_that_stops_without_a_ramp(servos: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    def brake(motion: Any, _: float) -> None:
        motion.hold()

    jog(servos)
    monkeypatch.setattr(_AxisMotion, "brake", brake)
    servos.robot.axes.stop([0, 1])
    servos.run(0.1)
    assert any("target changes by" in finding for finding in servos.findings)


def test_a_servo_that_comes_on_at_an_old_place(
    servos: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A hand has moved the joint meanwhile."""

    def old_goal(record: ServoRecord) -> Goal:
        assert record.acknowledged is not None
        return Goal(record.acknowledged, record.speed_limit)

    servos.run(0.1)
    servos.robot.axes.servo(0, False)
    servos.push(0, 0.4)
    servos.run(0.5)
    monkeypatch.setattr(switching, "_goal_here", old_goal)
    monkeypatch.setattr(switching, "_require_still", lambda *_: None)
    with servos.requested(), suppress(RobotdError):
        servos.robot.axes.servo(0, True)
    assert any("rad away from" in finding for finding in servos.findings)


def test_a_loaded_servo_that_is_led_to_where_it_was_measured_after_a_silence(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its goal is above that, by as much as the load bends it."""
    monkeypatch.setattr(ServoRecord, "_renew", renew_once)
    for made in started("feetech"):
        assert isinstance(made, ServoBench)
        made.servos[0].joint.load_nm = LOAD_NM
        made.run(0.5)
        assert made.findings == []
        made.silence(0.3, how="answers")
        made.run(0.6)
        assert any("target changes by" in finding for finding in made.findings)


def renew_once(record: ServoRecord) -> None:
    """Number an activation, and nothing after it."""
    record.activation = record.activations = 1
