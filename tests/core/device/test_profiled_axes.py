"""Moves, jogs, stops and streams of a controller that only takes position targets."""

from __future__ import annotations

import numpy as np
import pytest
from tests.fakes import FakeClock

from robotd.arrays import FloatArray
from robotd.device.process_image import ProcessImage
from robotd.device.profiled_axes import ProfiledAxes
from robotd.device.state import CommandMode, Operation
from robotd.errors import NotReady, Unsupported
from robotd.motion.profile import Profile

PERIOD_S = 0.002
PROFILE = Profile(1.0, 4.0, 2.0)


class Arm(ProfiledAxes):
    def __init__(self) -> None:
        self.fake = FakeClock()
        super().__init__(2, PERIOD_S, self.fake)
        self.image = ProcessImage(2)
        self.on = np.array([True, True])
        self.measured: FloatArray = np.array([0.5, -0.5])
        self.sent: list[FloatArray] = []
        self.frozen = self.deaf = False
        self.period(2)
        self.sent.clear()

    def read_feedback(self, image: ProcessImage) -> None:
        image.position[:], image.servo_on[:], image.offline[:] = self.measured, self.on, False
        if not self.frozen:
            image.fresh_ns = self.clock.now_ns()

    def send_targets(self, positions: FloatArray) -> None:
        self.sent.append(positions.copy())
        if not self.deaf:
            self.measured = np.where(self.on, positions, self.measured)

    def servo(self, axis: int, on: bool, timeout_s: float) -> None:
        self.on[axis] = on

    def clear_alarm(self, axis: int, timeout_s: float) -> None: ...

    def period(self, count: int = 1) -> None:
        for _ in range(count):
            self.fake.advance(PERIOD_S)
            self.read(self.image)

    def until_idle(self) -> np.ndarray:
        """Periods until both axes are idle; returns the commanded velocities, (k, 2)."""
        rows = []
        for _ in range(5000):
            self.period()
            rows.append(self.image.velocity_command.copy())
            if (self.image.operation == Operation.IDLE).all():
                return np.array(rows)
        raise AssertionError("still moving")


def test_a_move_keeps_to_both_ramps_and_arrives() -> None:
    arm = Arm()
    arm.move(0, 1.5, PROFILE)
    velocity = arm.until_idle()[:, 0]
    ramps = np.diff(velocity) / PERIOD_S
    assert velocity.max() == pytest.approx(1.0)
    assert ramps.max() == pytest.approx(4.0)
    assert ramps.min() == pytest.approx(-2.0)
    assert arm.image.position_command[0] == 1.5
    assert list(arm.image.motion_complete) == [True, False]
    assert np.array(arm.sent)[:, 1] == pytest.approx(-0.5)


@pytest.mark.parametrize(("quick", "ramp"), [(False, 2.0), (True, 20.0)])
def test_a_stop_uses_the_ramp_of_its_command_or_the_quick_one(quick: bool, ramp: float) -> None:
    arm = Arm()
    arm.move(0, 9.0, PROFILE)
    arm.period(400)
    (arm.quick_stop if quick else arm.stop)([0, 1])
    arm.period()
    assert arm.image.operation[0] == Operation.STOPPING
    velocity = arm.until_idle()[:, 0]
    assert np.diff(velocity).min() / PERIOD_S == pytest.approx(-ramp)
    assert not arm.image.motion_complete[0]


def test_a_jog_runs_until_it_is_set_to_zero() -> None:
    arm = Arm()
    arm.set_command_mode(0, CommandMode.VELOCITY)
    arm.jog(0, Profile(-0.5, 4.0, 2.0))
    arm.period(500)
    assert arm.image.velocity_command[0] == pytest.approx(-0.5)
    assert arm.image.operation[0] == Operation.VELOCITY
    arm.jog(0, Profile(0.0, 4.0, 2.0))
    assert arm.until_idle()[-1, 0] == 0.0


def test_setpoints_after_the_end_of_a_stream_send_no_second_targets() -> None:
    arm = Arm()
    arm.begin_stream([0])
    arm.stream(np.array([0.5, np.nan]), np.zeros(2), 0)
    arm.stop([0])
    arm.period()
    arm.sent.clear()
    arm.stream(np.array([0.7, np.nan]), np.zeros(2), 0)  # the sender has not noticed the stop
    arm.period()
    assert [targets[0] for targets in arm.sent] == pytest.approx([0.5])


def test_a_stream_is_sent_at_once_and_once_a_period() -> None:
    arm = Arm()
    arm.begin_stream([0])
    for step in range(1, 4):
        arm.stream(np.array([0.5 + 0.001 * step, np.nan]), np.array([0.5, np.nan]), 0)
        arm.period()
    assert [targets[0] for targets in arm.sent] == pytest.approx([0.501, 0.502, 0.503])
    assert np.isfinite(arm.sent).all()
    arm.period()  # a setpoint is late: the last one is held
    assert arm.sent[-1][0] == pytest.approx(0.503)
    arm.end_stream([0])
    arm.period()
    assert arm.image.operation[0] == Operation.IDLE
    assert arm.image.motion_complete[0]


@pytest.mark.parametrize("mode", [CommandMode.POSITION, CommandMode.VELOCITY])
@pytest.mark.parametrize("end", ["stop", "quick_stop", "end_stream"])
def test_a_stream_without_setpoints_is_at_rest_and_its_end_moves_nothing(
    mode: CommandMode, end: str
) -> None:
    arm = Arm()
    arm.set_command_mode(0, mode)
    arm.begin_stream([0])
    for step in range(1, 4):
        arm.stream(np.array([0.5 + 0.001 * step, np.nan]), np.array([0.5, np.nan]), 0)
        arm.period()
    arm.period(50)
    held = arm.image.position_command[0]
    assert arm.image.velocity_command[0] == 0.0
    getattr(arm, end)([0])
    arm.until_idle()
    assert arm.image.position_command[0] == held


def test_the_command_follows_an_axis_that_is_off_so_that_enabling_makes_no_jump() -> None:
    arm = Arm()
    arm.move(0, 2.0, PROFILE)
    arm.period(50)
    arm.on[0] = False
    arm.period()
    assert arm.image.operation[0] == Operation.IDLE
    arm.measured[0] = -3.0
    arm.period(2)
    arm.on[0] = True
    arm.period(3)
    assert arm.sent[-1][0] == -3.0
    assert arm.image.position_command[0] == -3.0


def roll(arm: Arm, *velocities: float) -> None:
    """Run a period in which both axes are streamed with ``velocities``."""
    arm.stream(np.full(2, np.nan), np.array(velocities), 0)
    arm.period()


def speeds(arm: Arm) -> FloatArray:
    """Return the velocities (k, 2) of the targets that were sent, from rest at the first one."""
    return np.diff(np.array([arm.sent[0], *arm.sent]), axis=0) / PERIOD_S


@pytest.mark.parametrize("pause_s", [0.006, 0.1])
@pytest.mark.parametrize("kind", ["move", "jog", "stop"])
def test_after_a_pause_of_the_control_loop_an_axis_goes_on_from_rest(
    kind: str, pause_s: float
) -> None:
    arm = Arm()
    if kind == "jog":
        arm.set_command_mode(0, CommandMode.VELOCITY)
        arm.jog(0, PROFILE)
    else:
        arm.move(0, 2.0, PROFILE)
    arm.period(200)
    if kind == "stop":
        arm.stop([0])
        arm.period(20)
    assert abs(arm.image.velocity_command[0]) > 0.5
    del arm.sent[:-1]
    arm.fake.advance(pause_s)
    if kind == "jog":
        arm.period(500)
        assert arm.image.velocity_command[0] == pytest.approx(1.0)
    else:
        arm.until_idle()
    assert arm.image.position_command[0] == pytest.approx(2.0) or kind != "move"
    assert np.abs(np.diff(speeds(arm)[:, 0])).max() <= 4.0 * PERIOD_S * 1.01
    if kind == "stop":
        assert np.abs(speeds(arm)).max() == 0.0


@pytest.mark.parametrize("within_a_period", [False, True])
def test_after_a_pause_streamed_wheels_go_on_from_rest_on_their_arc(within_a_period: bool) -> None:
    arm = Arm()
    for axis in (0, 1):
        arm.set_command_mode(axis, CommandMode.VELOCITY)
    arm.begin_stream([0, 1])
    for step in range(100):
        roll(arm, 0.1 * step, -0.05 * step)
    del arm.sent[:-1]
    arm.fake.advance(0.1)
    if not within_a_period:
        arm.period()
    for _ in range(1500):
        roll(arm, 9.9, -4.95)
    found = speeds(arm)
    assert np.abs(np.diff(found[:, 0])).max() <= 5.0 * PERIOD_S * 1.01  # the stop deceleration
    assert found[:, 1] == pytest.approx(-0.5 * found[:, 0])
    assert found[-1] == pytest.approx([9.9, -4.95])
    roll(arm, 8.9, -4.45)  # from now on as it is streamed
    assert speeds(arm)[-1] == pytest.approx([9.4, -4.7])


def test_motion_ends_when_the_feedback_stays_away() -> None:
    arm = Arm()
    arm.move(0, 9.0, PROFILE)
    arm.period(300)
    arm.frozen = True
    arm.period(400)
    assert arm.image.velocity_command[0] == 0.0
    assert arm.image.operation[0] == Operation.STOPPING  # nothing shows that it is at rest
    arm.frozen = False
    arm.period()
    assert arm.image.operation[0] == Operation.IDLE


@pytest.mark.parametrize("stops", [False, True])
def test_a_motion_has_ended_when_values_are_newer_than_its_last_target(stops: bool) -> None:
    arm = Arm()
    arm.move(0, 1.5, PROFILE)
    arm.period(300)
    if stops:
        arm.stop([0])
    while arm.image.velocity_command[0]:
        arm.period()
        arm.frozen = abs(arm.image.velocity_command[0]) < 0.02  # a cable is cut, not for long
    arm.period(50)
    moving = Operation.STOPPING if stops else Operation.POSITION
    assert (arm.image.operation[0], arm.image.motion_complete[0]) == (moving, False)
    arm.frozen = False
    arm.period()
    assert (arm.image.operation[0], arm.image.motion_complete[0]) == (Operation.IDLE, not stops)


def test_a_target_that_is_late_is_no_further_away() -> None:
    arm = Arm()
    arm.jog(0, PROFILE)
    arm.period(300)
    arm.sent.clear()
    for late in (0.0, 0.4, 0.9, 0.0):
        arm.fake.advance(late * PERIOD_S)
        arm.period()
    steps = np.diff(np.array(arm.sent)[:, 0])
    assert steps == pytest.approx(np.full(3, PROFILE.velocity * PERIOD_S))


@pytest.mark.parametrize("reconnect", [False, True])
def test_after_a_loss_axes_hold_where_they_are_found(reconnect: bool) -> None:
    """The controller keeps its servos on; the targets of the ramp did not arrive."""
    arm = Arm()
    arm.move(0, 9.0, PROFILE)
    arm.period(300)
    arm.frozen = arm.deaf = True
    arm.period(0 if reconnect else 400)
    arm.fake.advance(1.0)
    with pytest.raises(NotReady, match=r"^axis 0: no values arrive"):
        arm.move(0, 0.0, PROFILE)
    if reconnect:  # as the control loop does when communication ends
        arm.image.forget()
    stood = arm.measured.copy()
    arm.frozen = arm.deaf = False
    arm.sent.clear()
    arm.period(5)
    assert np.array(arm.sent) == pytest.approx(np.tile(stood, (5, 1)))
    assert (arm.image.operation == Operation.IDLE).all()
    arm.move(0, stood[0] + 0.01, PROFILE)
    arm.until_idle()
    assert arm.measured[0] == pytest.approx(stood[0] + 0.01)


def test_a_loaded_axis_does_not_sink_with_each_loss() -> None:
    arm = Arm()
    arm.period()
    held = arm.image.position_command.copy()
    for _ in range(5):
        arm.deaf, arm.measured = True, held - 0.002  # the weight of the arm
        arm.period(3)
        arm.frozen = True
        arm.period(150)
        arm.frozen = False
        arm.period(3)
    assert arm.sent[-1] == pytest.approx(held)


def test_an_axis_that_is_off_or_busy_takes_no_command() -> None:
    arm = Arm()
    arm.on[1] = False
    arm.period()
    with pytest.raises(NotReady, match=r"^axis 1: the servo is off"):
        arm.move(1, 0.0, PROFILE)
    arm.begin_stream([0])
    with pytest.raises(NotReady, match=r"^axis 0: takes no command while it is stream"):
        arm.move(0, 0.0, PROFILE)
    arm.fake.advance(1.0)
    with pytest.raises(NotReady, match=r"^axis 0: no values arrive"):
        arm.move(0, 0.0, PROFILE)
    with pytest.raises(Unsupported):
        arm.set_command_mode(0, CommandMode.TORQUE)


def test_an_axis_whose_drive_does_not_answer_keeps_its_command_and_goes_on_from_rest() -> None:
    arm = Arm()
    arm.move(0, 1.5, PROFILE)
    arm.move(1, 0.5, PROFILE)
    arm.period(100)
    before = arm.image.position_command.copy()
    arm.image.silent[0] = True
    arm.period(50)
    assert arm.image.position_command[0] == before[0]
    assert arm.image.position_command[1] > before[1] + 0.01
    arm.image.silent[0] = False
    velocity = arm.until_idle()[:, 0]
    assert velocity[0] <= PROFILE.acceleration * PERIOD_S + 1e-9
    assert arm.image.position_command == pytest.approx([1.5, 0.5])


def test_a_silent_axis_goes_on_from_the_target_that_its_driver_gives_it() -> None:
    arm = Arm()
    arm.move(0, 1.5, PROFILE)
    arm.period(100)
    kept = arm.image.position_command[0] - 0.01  # the last targets did not arrive
    arm.image.silent[0], arm.image.position_command[0] = True, kept
    arm.period(3)
    assert arm.image.position_command[0] == kept
    arm.image.silent[0] = False
    steps = np.diff(arm.until_idle()[:, 0])
    assert np.abs(steps).max() <= PROFILE.velocity
    assert arm.image.position_command[0] == pytest.approx(1.5)


def test_an_axis_that_is_silent_as_it_comes_on_begins_at_the_target_of_its_drive() -> None:
    arm = Arm()
    arm.on[0] = False
    arm.period()
    arm.on[0], arm.image.silent[0], arm.image.position_command[0] = True, True, 0.3
    arm.period()
    arm.image.silent[0] = False
    arm.period(2)
    assert arm.sent[-1][0] == 0.3
