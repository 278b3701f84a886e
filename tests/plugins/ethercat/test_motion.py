"""Servo, moves, streams and jogs on the fake bus."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.plugins.ethercat.fake_bus import COUNTS_PER_RAD
from tests.plugins.ethercat.harness import Harness

from robotd.device.state import CommandMode, Operation
from robotd.errors import LateSetpoint
from robotd.motion import TrajectoryRequest
from robotd.motion.profile import Profile

PERIOD_NS = 2_000_000


def test_servos_go_on_with_the_command_at_the_measured_position(harness: Harness) -> None:
    assert harness.image.servo_on.all()
    assert harness.image.position_command == pytest.approx(harness.image.position, abs=1e-3)
    assert all(slave.values[0x6060, 0] == 8 for slave in harness.bus.all[:2])


def test_a_trajectory_is_followed_to_its_end(harness: Harness) -> None:
    request = TrajectoryRequest.from_rows(harness.robot.joint_names, [1.0], [[0.3, -0.2]])
    with harness.robot.follower.follow(request) as execution:
        harness.until(lambda: execution.done)
    assert harness.image.position == pytest.approx([0.3, -0.2], abs=2e-3)


def test_mapped_outputs_without_a_part_keep_the_values_of_the_drive(harness: Harness) -> None:
    """A torque limit of 0 in the first frame would take the torque from the drive."""
    assert harness.slave(0).values[0x6072, 0] == 3000


def test_a_mapped_demand_is_the_command_of_the_drive(harness: Harness) -> None:
    """The mapping is known after bring-up only, when the axes have been made."""
    image, report = harness.master.slaves[0].image, harness.master.axes[0].report
    demand = image.input_slots[0x6062, 0]
    image.inputs = [v + 500 * (slot == demand) for slot, v in enumerate(image.inputs)]
    report.update()
    assert report.demand() == pytest.approx(report.position + 500 / COUNTS_PER_RAD)


def test_a_jog_in_cyclic_velocity_ends_at_rest(harness: Harness) -> None:
    axes = harness.robot.axes
    axes.set_command_mode(0, CommandMode.VELOCITY)
    axes._driver.jog(0, Profile(0.5, 5.0, 5.0))
    harness.until(lambda: harness.image.velocity[0] > 0.45)
    assert harness.slave(0).values[0x6060, 0] == 9
    axes.stop([0])
    harness.until(lambda: harness.image.operation[0] == Operation.IDLE)
    assert abs(harness.image.velocity[0]) < 0.02


def test_a_move_runs_as_a_profile_of_the_drive(harness: Harness) -> None:
    driver = harness.robot.axes._driver
    driver.move(1, 0.2, Profile(1.0, 5.0, 5.0))
    harness.until(lambda: harness.image.motion_complete[1])
    assert harness.image.position[1] == pytest.approx(0.2, abs=2e-3)


def test_homing_makes_the_present_position_zero(harness: Harness) -> None:
    driver = harness.robot.axes._driver
    driver.move(0, 0.1, Profile(1.0, 5.0, 5.0))
    harness.until(lambda: harness.image.motion_complete[0])
    driver.home(0, 2.0)
    assert harness.image.home_done[0]
    assert harness.image.position[0] == pytest.approx(0.0, abs=2e-3)


def test_streaming_axes_stop_without_setpoints(harness: Harness) -> None:
    driver = harness.robot.axes._driver
    driver.begin_stream([0])
    assert harness.image.operation[0] == Operation.STREAM
    harness.until(lambda: harness.image.operation[0] == Operation.IDLE)
    assert "no setpoint for 0.1 s" in harness.master.supervision.faults[-1]


def test_the_image_is_of_the_frame_of_this_period(harness: Harness) -> None:
    harness.robot.step(3)
    assert harness.image.fresh_ns == harness.master.exchange.sent_ns == harness.image.stamp_ns


def test_a_frame_that_is_not_back_in_time_is_received_in_the_next_period(harness: Harness) -> None:
    harness.robot.step(3)
    before_ns = harness.image.stamp_ns
    for _ in range(2):
        harness.bus.slow_frames = 1
        harness.robot.step(1)
        assert harness.image.fresh_ns == before_ns
        before_ns = harness.image.stamp_ns
    harness.robot.step(1)
    assert harness.image.fresh_ns == harness.image.stamp_ns
    assert harness.master.exchange.counters.lost == 0


class Periods:
    """Periods of a master whose axes stream, as the control loop runs them."""

    def __init__(self, harness: Harness) -> None:
        self.harness, self.clock, self.master = harness, harness.clock, harness.master
        harness.robot.axes._driver.begin_stream([0, 1])
        harness.clock.detach()
        self.due_ns = self.clock.now_ns() + PERIOD_NS
        self.position = 0.0
        for _ in range(5):
            self.run()

    def run(self, *, before_read_ns: int = 0, after_read_ns: int = 0) -> None:
        """One period from its nominal time on; the process is stopped before or after ``read``."""
        self.read(before_read_ns)
        self.clock._now_ns += after_read_ns
        self.position += 0.001
        self.master.stream(np.full(2, self.position), np.full(2, 0.5), self.due_ns)

    def read(self, late_ns: int = 0) -> None:
        """Begin a period, ``late_ns`` after its nominal time."""
        self.clock._now_ns = max(self.clock.now_ns(), self.due_ns) + late_ns
        self.due_ns += PERIOD_NS
        self.master.read(self.harness.image)

    def notice_stall(self) -> None:
        """Go on now, as the control loop does when deadlines have passed."""
        self.due_ns = self.clock.now_ns()

    @property
    def sent(self) -> float:
        """Position in the frame that was sent last."""
        return self.harness.slave(0).values[0x607A, 0] / COUNTS_PER_RAD


@pytest.fixture
def periods(harness: Harness) -> Periods:
    return Periods(harness)


def test_a_setpoint_leaves_with_the_next_frame(periods: Periods) -> None:
    streamed = periods.position
    periods.run()
    assert periods.sent == pytest.approx(streamed)


def test_a_stop_begins_after_the_setpoint_that_waits_for_its_frame(periods: Periods) -> None:
    """The drive would move by the way of two periods in one."""
    before, streamed = periods.sent, periods.position
    periods.harness.robot.axes._driver.stop([0, 1])
    sent = []
    for _ in range(2):
        periods.read()
        sent.append(periods.sent)
    assert sent[0] == pytest.approx(streamed)
    assert 0 < sent[1] - sent[0] < sent[0] - before


def test_a_setpoint_from_before_a_stall_is_where_the_drives_are(periods: Periods) -> None:
    """They have continued for one period after the frame before it."""
    periods.run(after_read_ns=30_000_000)
    streamed = periods.position
    periods.notice_stall()
    periods.run()
    assert periods.sent == pytest.approx(streamed)


def test_a_setpoint_is_not_sent_after_a_frame_that_came_after_a_stall(periods: Periods) -> None:
    """The drives have stopped; the control loop has not noticed the stall yet."""
    with pytest.raises(LateSetpoint):
        periods.run(before_read_ns=30_000_000)
    held = periods.sent
    periods.notice_stall()
    periods.run()
    assert periods.sent == pytest.approx(held)


def test_a_stall_while_the_frame_is_encoded_is_seen(
    periods: Periods, monkeypatch: pytest.MonkeyPatch
) -> None:
    io: Any = periods.master.io
    pack = io.pack

    def slow_pack() -> None:
        pack()
        periods.clock._now_ns += 30_000_000

    monkeypatch.setattr(io, "pack", slow_pack)
    with pytest.raises(LateSetpoint):
        periods.run()


def test_the_drives_count_from_the_nominal_time_of_the_frame_before(periods: Periods) -> None:
    """It was sent late, so that less than two periods lie between the two."""
    periods.run(before_read_ns=PERIOD_NS * 4 // 10)
    with pytest.raises(LateSetpoint):
        periods.run(before_read_ns=PERIOD_NS * 12 // 10)


def test_a_late_frame_waits_until_its_periods_are_counted_alike(periods: Periods) -> None:
    """At the end of a period the drives may count one more or one less."""
    periods.due_ns = periods.master.timing.time_ns + 2 * PERIOD_NS  # one period is missed
    begin_ns = periods.due_ns
    periods.run()
    waited_ns = periods.master.exchange.sent_ns - begin_ns
    assert waited_ns == pytest.approx(PERIOD_NS / 10, abs=PERIOD_NS / 100)
