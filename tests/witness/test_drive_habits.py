"""Habits of real drives, on both fieldbuses: homing, wraps, brakes, gears, late power, slow SDO."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from structlog.testing import capture_logs
from tests.plugins.independent.canopen_objects import Entry
from tests.plugins.independent.cia402_node import ENERGISED, State
from tests.witness.bench import COUNTS_PER_RAD, Bench
from tests.witness.canopen_bench import CanopenBench
from tests.witness.ethercat_bench import EthercatBench

from robotd.device.axes import Jog, Move
from robotd.device.process_image import ProcessImage
from robotd.device.state import CommandMode
from robotd.errors import ConnectError, OperationError, RobotdError
from robotd.motion import TrajectoryRequest
from robotd.motion.profile import Profile
from robotd_canopen.master import Master
from robotd_cia402.power_commands import PowerCommands
from robotd_ethercat.soem import Soem

HabitBench = CanopenBench | EthercatBench
BUSES: dict[str, type[HabitBench]] = {"canopen": CanopenBench, "ethercat": EthercatBench}
EACH_BUS = pytest.mark.parametrize("bus", BUSES)
SPEEDS = {
    "homing_speed_rad_s": 0.5, "homing_creep_rad_s": 0.2, "homing_acceleration_rad_s2": 5.0,
}  # fmt: skip


@contextmanager
def opened(bus: str | type[HabitBench], **options: Any) -> Iterator[HabitBench]:
    kind = BUSES[bus] if isinstance(bus, str) else bus
    bench = kind(**{"axes": 1, **options})
    try:
        yield bench
    finally:
        bench.robot.shutdown()
        bench.close()


@contextmanager
def started(bus: str, **options: Any) -> Iterator[HabitBench]:
    with opened(bus, **options) as bench:
        start(bench)
        yield bench


def start(bench: HabitBench) -> None:
    with bench.requested():
        bench.robot.start()


def move(bench: HabitBench, target: float, seconds: float = 1.0) -> None:
    names = bench.robot.joint_names
    request = TrajectoryRequest.from_rows(names, [seconds], [[target] * len(names)])
    with bench.robot.follower.follow(request):
        bench.run(seconds + 0.5)


def in_motion(bench: HabitBench, act: Callable[[], None]) -> None:
    """Let ``act`` happen once, in the control loop, when the axis is at -0.1 rad."""
    robot, acts = bench.robot, [act]

    def watch(image: ProcessImage) -> None:
        if image.position[0] < -0.1 and acts:
            acts.pop()()

    robot.control_loop.every(robot.descriptor.cycle.rate_hz, "act", watch)


def require_followed(bench: HabitBench, target: float) -> None:
    move(bench, target)
    assert bench.drives[0].position_rad == pytest.approx(target, abs=1e-3)
    assert bench.findings == []


@EACH_BUS
@pytest.mark.parametrize(
    ("method", "home"),
    [(35, 100_000), (37, 100_000), (17, 20_000), (18, 400_000), (33, 0), (34, 1_000_000)],
)
def test_homing_ends_at_its_mark_and_the_axis_holds_there(bus: str, method: int, home: int) -> None:
    """Methods 35 and 37 stay, 17 and 18 search a limit switch, 33 and 34 the index pulse."""
    switches = {"negative_limit": 20_000, "positive_limit": 400_000}
    homing = {"homing_method": method, **SPEEDS}
    with started(bus, drive=homing, power_on_position=100_000, **switches) as bench:
        bench.robot.axes.home(0)
        axis = bench.drives[0].axis
        assert axis.counts_at_zero == home
        assert bench.robot.image.home_done[0]
        assert bench.robot.image.position[0] == pytest.approx(bench.drives[0].position_rad)
        held = (axis.demand - home) / COUNTS_PER_RAD
        assert bench.robot.image.position_command[0] == pytest.approx(held, abs=1e-3)
        require_followed(bench, 0.2)


@EACH_BUS
@pytest.mark.parametrize("method", [-1, 1])
def test_a_homing_method_that_the_drive_lacks_moves_nothing(bus: str, method: int) -> None:
    with started(bus, drive={"homing_method": method}, power_on_position=100_000) as bench:
        with pytest.raises(RobotdError, match="0x6098"):
            bench.robot.axes.home(0)
        bench.run(0.2)
        assert not bench.robot.image.home_done[0]
        assert bench.drives[0].axis.max_velocity < 10
        require_followed(bench, 0.2)


@EACH_BUS
@pytest.mark.parametrize(
    ("moves", "how"), [(False, r"(in motion|at rest)"), (True, "in motion; it is stopped by")]
)
def test_a_homing_error_names_axis_method_and_motion_and_ends_at_rest(
    bus: str, moves: bool, how: str
) -> None:
    """Bit 13 with bit 10: an error at rest; without it, the axis still moves (CiA 402-2)."""
    errors = {"homing_error_s": 0.3, "homing_error_moves": moves}
    with started(bus, drive={"homing_method": 17, **SPEEDS}, **errors) as bench:
        begun_s = bench.now_s
        text = rf"joint1: .*homing by method 17 \(0x6098\) failed: .*homing error {how}.*; check"
        with pytest.raises(OperationError, match=text):
            bench.robot.axes.home(0)
        axis = bench.drives[0].axis
        assert bench.now_s - begun_s < 1.0
        assert abs(axis.velocity) < 0.01 * COUNTS_PER_RAD
        assert axis.position < -0.05 * COUNTS_PER_RAD  # it had moved
        rest = axis.position
        bench.run(0.5)
        assert axis.position == pytest.approx(rest, abs=0.01 * COUNTS_PER_RAD)
        assert not bench.robot.image.home_done[0]
        require_followed(bench, 0.2)


@EACH_BUS
def test_a_homing_error_at_rest_is_named_as_such(bus: str) -> None:
    with started(bus, drive={"homing_method": 37, **SPEEDS}, homing_error_s=0.0) as bench:
        with pytest.raises(OperationError, match=r"method 37 .*homing error at rest"):
            bench.robot.axes.home(0)
        assert bench.drives[0].power is State.ENABLED
        assert not bench.robot.image.home_done[0]
        require_followed(bench, 0.2)


@EACH_BUS
def test_a_homing_that_is_stopped_says_so(bus: str) -> None:
    with started(bus, drive={"homing_method": 17, **SPEEDS}) as bench:
        axis = bench.drives[0].axis
        in_motion(bench, lambda: bench.driver.master.stop([0]))
        with pytest.raises(OperationError, match=r"homing by method 17 \(0x6098\) was stopped"):
            bench.robot.axes.home(0)
        assert abs(axis.velocity) < 0.01 * COUNTS_PER_RAD
        assert -0.3 * COUNTS_PER_RAD < axis.position < -0.1 * COUNTS_PER_RAD
        assert not bench.robot.image.home_done[0]
        require_followed(bench, 0.2)


@EACH_BUS
def test_a_homing_that_ends_in_an_alarm_names_it(bus: str) -> None:
    with started(bus, drive={"homing_method": 17, **SPEEDS}) as bench:
        in_motion(bench, lambda: bench.trip(0))
        with pytest.raises(OperationError, match=r"method 17 .* in an alarm of the drive: .*2310"):
            bench.robot.axes.home(0)


class Endless(Bench):
    """The joint has no position limits, and neither has its judge."""

    def describe(self, rate_hz: float, engine: dict[str, Any] | None = None) -> dict[str, Any]:
        found = super().describe(rate_hz, engine)
        for joint, judge in zip(found["joints"], self.judges, strict=True):
            joint["type"] = "continuous"
            del joint["lower_rad"], joint["upper_rad"]
            judge.lower, judge.upper = -math.inf, math.inf
        return found


class EndlessCanopen(Endless, CanopenBench):
    pass


class EndlessEthercat(Endless, EthercatBench):
    pass


@pytest.mark.parametrize("bus", [EndlessCanopen, EndlessEthercat])
def test_a_path_goes_on_where_the_position_runs_over_32_bits(bus: type[HabitBench]) -> None:
    with opened(bus, power_on_position=2**31 - 100_000) as bench:
        start(bench)
        before, axis = bench.robot.image.position[0], bench.drives[0].axis
        move(bench, before + 0.2)
        assert bench.drives[0][0x6064] < 0
        assert axis.position == pytest.approx(2**31 + 100_000, abs=1_000)
        assert axis.max_velocity < 3.14 * COUNTS_PER_RAD
        assert bench.robot.image.position[0] == pytest.approx(before + 0.2, abs=1e-3)


def set_position_range(bench: HabitBench, lowest: int, highest: int) -> None:
    low, high = Entry("Min", "i", lowest), Entry("Max", "i", highest)
    bench.drives[0].add(0x607B, "Position range limit", low, high)


@pytest.mark.parametrize(
    ("bus", "lowest", "highest"),
    [
        (CanopenBench, -COUNTS_PER_RAD, COUNTS_PER_RAD),  # the joint has -3 to 3 rad
        (EthercatBench, 0, 100 * COUNTS_PER_RAD),
        (EndlessCanopen, -(2**30), 2**30),
        (EndlessEthercat, -(2**30), 2**30),
        (CanopenBench, -(2**15), 2**15 - 1),
        (EthercatBench, -(2**15), 2**15 - 1),
        (EndlessCanopen, 0, 2**16 - 1),
        (EndlessEthercat, 0, 2**16 - 1),
    ],
)
def test_a_position_range_that_the_joint_leaves_ends_the_start(
    bus: type[HabitBench], lowest: int, highest: int
) -> None:
    """A target beyond it would be taken for one at the other end (CiA 402-2, 0x607B)."""
    with opened(bus) as bench:
        set_position_range(bench, lowest, highest)
        with pytest.raises(ConnectError, match=f"0x607B.* wrap at {lowest} and {highest} counts"):
            bench.robot.start()
        assert bench.drives[0].power is not State.ENABLED


@pytest.mark.parametrize(
    ("bus", "lowest", "highest"),
    [
        (CanopenBench, 0, 0),
        (EthercatBench, -4 * COUNTS_PER_RAD, 4 * COUNTS_PER_RAD),
        (EndlessCanopen, -(2**31), 2**31 - 1),
        (EndlessEthercat, 0, 0),
    ],
)
def test_a_position_range_that_the_joint_stays_in_is_accepted(
    bus: type[HabitBench], lowest: int, highest: int
) -> None:
    with opened(bus) as bench:
        set_position_range(bench, lowest, highest)
        start(bench)
        require_followed(bench, 0.2)


@EACH_BUS
def test_positions_of_16_bits_end_the_start_with_the_object(bus: str) -> None:
    """CiA 402-2 has 32 bits; these would wrap within the range of the joint."""
    text = r"0x60(64|7A) .* has 16 bits .* wrap after 65536 counts; use a firmware"
    with pytest.raises(RobotdError, match=text), opened(bus, position_bits=16) as bench:
        bench.robot.start()


@EACH_BUS
@pytest.mark.parametrize("drive", [{"brake_release_s": 0.4}, {}], ids=["by key", "by bit 12"])
def test_no_setpoint_runs_ahead_of_a_brake(bus: str, drive: dict[str, float]) -> None:
    """A drive shows in bit 12 of a cyclic mode whether it follows setpoints (CiA 402-2)."""
    engine = {"servo_timeout_s": 2.0}
    with started(bus, engine=engine, drive=drive, brake_release_s=0.35) as bench:
        assert not bench.drives[0].axis.is_braked
        require_followed(bench, 0.5)
        assert bench.drives[0].axis.max_velocity < 3.14 * COUNTS_PER_RAD


@EACH_BUS
@pytest.mark.parametrize("brake_s", [0.0, 0.35])
def test_a_drive_without_bit_12_is_switched_on_and_followed(bus: str, brake_s: float) -> None:
    drive = {"brake_release_s": brake_s and 0.4}
    engine = {"servo_timeout_s": 2.0}
    habits = {"brake_release_s": brake_s, "following_bit": False}
    with started(bus, engine=engine, drive=drive, **habits) as bench:
        require_followed(bench, 0.5)
        assert bench.drives[0].axis.max_velocity < 3.14 * COUNTS_PER_RAD
        bench.robot.axes.servo(0, on=False)
        begun_s = bench.now_s
        with bench.requested():
            bench.robot.axes.servo(0, on=True)
        assert bench.now_s - begun_s < 0.1 + brake_s + 0.05  # it is not waited for again


def follow_path(bench: HabitBench) -> None:
    require_followed(bench, 0.5)


def move_by_profile(bench: HabitBench) -> None:
    bench.robot.axes.move([Move(0, 0.5, Profile(1.0, 5.0, 5.0))])
    bench.run(1.5)
    assert bench.robot.image.motion_complete[0]


def jog_and_stop(bench: HabitBench) -> None:
    bench.robot.axes.set_command_mode(0, CommandMode.VELOCITY)
    bench.robot.axes.jog([Jog(0, Profile(0.5, 5.0, 5.0))])
    bench.run(1.0)
    bench.robot.axes.jog([Jog(0, Profile(0.0, 5.0, 5.0))])
    bench.run(0.5)


def stream_positions(bench: HabitBench) -> None:
    with bench.robot.stream() as stream:
        for step in range(250):
            stream.send([0.5 * (step + 1) / 250])
            bench.run(0.004)
        bench.run(0.5)


def search_home(bench: HabitBench) -> None:
    bench.robot.axes.home(0)
    assert bench.robot.image.home_done[0]


@EACH_BUS
@pytest.mark.parametrize(
    "motion", [follow_path, move_by_profile, jog_and_stop, stream_positions, search_home]
)
def test_a_motion_that_begins_before_the_brake_is_released_waits(
    bus: str, motion: Callable[[HabitBench], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As that of a client that sees the servo on while another one switches it on."""
    drive = {"brake_release_s": 0.4, "homing_method": 17, **SPEEDS}
    knobs = {"brake_release_s": 0.35, "negative_limit": -100_000}
    monkeypatch.setattr(PowerCommands, "wait_for_brake", lambda *_: None)
    monkeypatch.setattr(PowerCommands, "wait_until_followed", lambda *_: None)
    with started(bus, drive=drive, **knobs) as bench:
        axis, braked = bench.drives[0].axis, list[str]()
        assert axis.is_braked

        def watch(image: ProcessImage) -> None:
            setpoint = image.velocity_command[0]
            if axis.is_braked and (setpoint or axis.drive[0x6061] not in (8, 3, 9)):
                braked.append(f"{setpoint} in mode {axis.drive[0x6061]}")

        bench.robot.control_loop.every(250.0, "brake", watch)
        motion(bench)
        assert braked == []
        assert not axis.is_braked
        assert abs(axis.position) > 0.09 * COUNTS_PER_RAD
        assert axis.max_velocity < 3.14 * COUNTS_PER_RAD
        assert bench.findings == []


@EACH_BUS
def test_a_brake_that_needs_longer_than_a_servo_may_is_named(bus: str) -> None:
    with opened(bus, drive={"brake_release_s": 0.8}) as bench:
        with pytest.raises(RobotdError, match="brake_release_s"):
            start(bench)
        bench.run(0.1)
        assert bench.drives[0].power is not State.ENABLED


HANGING = {"brake_close_s": 0.1, "fall": 9.81 * COUNTS_PER_RAD}  # falls by 0.05 rad meanwhile


def switch_off(bench: HabitBench) -> None:
    bench.robot.axes.servo(0, on=False)


def stop_and_switch_off(bench: HabitBench) -> None:
    bench.robot.stop()
    switch_off(bench)


def quick_stop_and_switch_off(bench: HabitBench) -> None:
    bench.driver.master.quick_stop([0])
    bench.run(0.5)
    switch_off(bench)


def shut_down(bench: HabitBench) -> None:
    bench.robot.shutdown()


def quick_stop_and_shut_down(bench: HabitBench) -> None:
    bench.driver.master.quick_stop([0])
    bench.run(0.5)
    bench.robot.shutdown()


@EACH_BUS
@pytest.mark.parametrize(
    "off",
    [
        switch_off, stop_and_switch_off, shut_down,
        quick_stop_and_switch_off, quick_stop_and_shut_down,
    ],
)  # fmt: skip
@pytest.mark.parametrize("moves", [False, True])
def test_an_axis_that_hangs_on_its_drive_is_held_until_the_brake_is_closed(
    bus: str, off: Callable[[HabitBench], None], moves: bool
) -> None:
    with started(bus, drive={"hanging_load": True}, **HANGING) as bench:
        axis = bench.drives[0].axis
        require_followed(bench, 0.5)
        if moves:
            bench.robot.axes.move([Move(0, 2.0, Profile(1.0, 5.0, 5.0))])
            bench.run(0.5)
        lowest = axis.position
        off(bench)
        bench.run(0.3)
        assert bench.drives[0].power not in ENERGISED
        assert axis.position > lowest - 1e-3 * COUNTS_PER_RAD
        assert bench.findings == []


@EACH_BUS
def test_a_hanging_axis_whose_switching_on_fails_is_held_until_the_brake_is_closed(
    bus: str,
) -> None:
    with opened(bus, drive={"brake_release_s": 0.8}, **HANGING) as bench:
        axis = bench.drives[0].axis
        with pytest.raises(RobotdError, match="brake_release_s"):
            start(bench)
        bench.run(0.3)
        assert bench.drives[0].power not in ENERGISED
        assert abs(axis.position) < 1e-3 * COUNTS_PER_RAD


@EACH_BUS
@pytest.mark.parametrize(("feed", "gear"), [(2_000_000, 1), (36_000, 1), (COUNTS_PER_RAD, 4)])
def test_a_gear_ratio_in_the_drive(bus: str, feed: int, gear: int) -> None:
    """``counts_per_rad`` has position units of the drive, which differ from encoder counts."""
    with opened(bus, feed=feed) as bench:
        bench.drives[0].objects[0x6091, 1].value = gear
        start(bench)
        require_followed(bench, 0.2)
        turns = 0.2 * COUNTS_PER_RAD / feed * gear
        counts = bench.drives[0].axis.position
        assert counts == pytest.approx(turns * COUNTS_PER_RAD, rel=1e-3)


@pytest.mark.parametrize("delay_s", [0.25, 1.0])
def test_slow_answers_of_sdo_on_ethercat(delay_s: float) -> None:
    """On CANopen they come in real time: tests/plugins/independent/test_start.py."""
    section, engine = {"sdo_timeout_s": 1.5}, {"communication_timeout_s": 120.0}
    slow = {"section": section, "engine": engine, "sdo_delay_s": delay_s}
    with capture_logs() as logs, started("ethercat", **slow) as bench:
        require_followed(bench, 0.2)
    progress = [line for line in logs if line["event"] == "configuring takes long"]
    assert progress
    assert all("slave 0" in line["step"] and line["each_s"] == delay_s for line in progress)


def test_a_start_on_ethercat_that_would_take_too_long_says_what_to_raise() -> None:
    section = {"sdo_timeout_s": 1.5}
    text = r"slave 0.* SDO transfers took 1 s each; raise engine.communication_timeout_s"
    with opened("ethercat", section=section, sdo_delay_s=1.0) as bench:
        with pytest.raises(ConnectError, match=text):
            bench.robot.start()
        assert bench.drives[0].power is not State.ENABLED


def test_answers_of_sdo_that_are_slower_than_their_time_name_the_object() -> None:
    with opened("ethercat", sdo_delay_s=1.0) as bench:
        with pytest.raises(ConnectError, match=r"0x[0-9A-F]{4}"):
            bench.robot.start()
        assert bench.drives[0].power is not State.ENABLED


def test_a_node_that_boots_late_is_awaited(monkeypatch: pytest.MonkeyPatch) -> None:
    """Node 6 has power, and boots for 1 s; 0.3 s pass from one of the tries to the next."""
    open_once, tries = Master.open, list[float]()
    with opened("canopen", axes=2, engine={"open_tries": 5, "open_retry_s": 0.01}) as bench:
        bench.drives[1].knobs.boot_s = 1.0
        bench.drives[1].restart()
        booted_s = bench.now_s + 1.0

        def open_later(master: Master) -> None:
            bench.run(0.3)
            tries.append(bench.now_s)
            open_once(master)

        monkeypatch.setattr(Master, "open", open_later)
        with capture_logs() as logs:
            start(bench)
        failures = [line["reason"] for line in logs if line["event"] == "open failed"]
        assert len(failures) == len([one for one in tries if one < booted_s]) == len(tries) - 1
        assert len(failures) >= 2
        assert all("joint2 (node 6)" in text and "node 5" not in text for text in failures)
        require_followed(bench, 0.2)


@pytest.mark.parametrize("timeout_s", [2.0, 0.5])
def test_a_slave_whose_application_boots_is_awaited(timeout_s: float) -> None:
    """Its slave controller answers before that, so that it is found."""
    with opened("ethercat", axes=2, section={"state_timeout_s": timeout_s}) as bench:
        bench.slaves[1].boot_s = bench.now_s + 1.0
        if timeout_s < 1.0:
            text = r"slave 1.*PreOp requested.* no error within 0.5 s; raise state_timeout_s"
            with pytest.raises(ConnectError, match=text):
                bench.robot.start()
            return
        start(bench)
        require_followed(bench, 0.2)


def test_a_slave_that_gets_power_late_is_awaited(monkeypatch: pytest.MonkeyPatch) -> None:
    """Slave 1 has power at the third of the tries."""
    search, tries = Soem.find_slaves, list[int]()
    with opened("ethercat", axes=2, engine={"open_tries": 5, "open_retry_s": 0.01}) as bench:
        bench.cable.cut_at = 1

        def find(bus: Soem) -> int:
            if len(tries) == 2:
                bench.cable.cut_at = None
            tries.append(search(bus))
            return tries[-1]

        monkeypatch.setattr(Soem, "find_slaves", find)
        start(bench)
        assert tries == [1, 1, 2]
        require_followed(bench, 0.2)
