"""Faults that users of CANopen drivers have reported, each on a drive with that habit."""

from __future__ import annotations

import json
import math

import pytest
from click.testing import CliRunner
from tests.plugins.independent.conftest import NODE, START_RAD, OpenBench

from robotd.cli import main
from robotd.control.loop.setpoint_source import Outcome
from robotd.device.axes import Jog
from robotd.device.state import CommandMode
from robotd.errors import ConnectError, DeviceTimeout, RobotdError
from robotd.motion.profile import Profile

EVENT_DRIVEN = [
    {"number": 1, "objects": ["0x6041", "0x6061"]},
    {"number": 3, "transmission": 255, "objects": ["0x6064"]},
]
SAVE = "0x65766173"


def test_plain_drive_follows_without_a_jump(open_bench: OpenBench) -> None:
    with open_bench() as bench:
        bench.robot.start()
        assert bench.image.position[0] == pytest.approx(START_RAD, abs=1e-3)
        assert bench.move(2.0).outcome is Outcome.SUCCEEDED
        assert not bench.has_jumped()
        assert bench.drive["position"] == pytest.approx(20_000, abs=20)


# The position


def test_event_driven_position_is_known_before_the_axis_is_energised(
    open_bench: OpenBench,
) -> None:
    with open_bench(
        axis={"tpdos": EVENT_DRIVEN}, event_position=True, position_alone=True
    ) as bench:
        bench.robot.start()
        assert bench.image.position[0] == pytest.approx(START_RAD, abs=1e-3)
        assert bench.drive["counts"]["enabled_blind"] == 0
        assert bench.move(2.0).outcome is Outcome.SUCCEEDED
        assert not bench.has_jumped()


def test_event_driven_position_that_cannot_be_read_leaves_the_axis_off(
    open_bench: OpenBench,
) -> None:
    with open_bench(
        axis={"tpdos": EVENT_DRIVEN},
        event_position=True,
        position_alone=True,
        sdo_mute=(0x6064,),
    ) as bench:
        with pytest.raises((ConnectError, DeviceTimeout)) as failed:
            bench.robot.start()
        assert "0x6064" in str(failed.value)
        assert "enabled" not in bench.drive["counts"]


def test_position_in_a_tpdo_of_its_own(open_bench: OpenBench) -> None:
    tpdos = [*EVENT_DRIVEN[:1], {"number": 3, "objects": ["0x6064"]}]
    with open_bench(axis={"tpdos": tpdos}, position_alone=True) as bench:
        bench.robot.start()
        assert bench.move(2.0).outcome is Outcome.SUCCEEDED
        assert bench.drive["counts"]["enabled_blind"] == 0
        assert not bench.has_jumped()


# The node


def test_drive_that_starts_by_itself_is_configured(open_bench: OpenBench) -> None:
    with open_bench(self_starting=True, heartbeat_ms=50) as bench:
        bench.robot.start()
        assert bench.image.position[0] == pytest.approx(START_RAD, abs=1e-3)
        assert bench.move(2.0).outcome is Outcome.SUCCEEDED
        assert not bench.has_jumped()
        assert bench.robot.fieldbus.status(0).lost_frames == 0


def test_boot_up_in_motion_stops_and_recovers_without_a_jump(open_bench: OpenBench) -> None:
    with open_bench() as bench:
        bench.robot.start()
        with bench.moving(-1.0, 2.0) as execution:
            bench.until(lambda: bench.image.position[0] < 1.3)
            bench.drive.do("restart")
            assert execution.wait(10)
        assert execution.outcome is Outcome.FAULT
        assert "reset" in execution.message
        bench.drive.wait(lambda measured: abs(measured["velocity"]) < 1)
        assert not bench.drive["energised"]
        bench.drive.do("clear")
        bench.robot.recover()
        assert bench.move(0.5).outcome is Outcome.SUCCEEDED
        assert not bench.has_jumped()


def test_drop_to_pre_operational_stops_and_recovers(open_bench: OpenBench) -> None:
    with open_bench() as bench:
        bench.robot.start()
        with bench.moving(-1.0, 2.0) as execution:
            bench.until(lambda: bench.image.position[0] < 1.3)
            bench.drive.do("pre_operational")
            assert execution.wait(10)
        assert execution.outcome is Outcome.FAULT
        assert "pre-operational" in execution.message
        bench.drive.do("clear")
        bench.robot.recover()
        assert bench.drive["energised"]
        assert bench.move(0.5).outcome is Outcome.SUCCEEDED
        assert not bench.has_jumped()


# Objects


def test_fault_is_named_by_its_emergency_where_0x603f_is_0(open_bench: OpenBench) -> None:
    with open_bench(code_in_603f=False) as bench:
        bench.robot.start()
        with bench.moving(-1.0, 2.0) as execution:
            bench.until(lambda: bench.image.position[0] < 1.3)
            bench.drive.do("fault", code=0x3210)
            assert execution.wait(10)
        assert execution.outcome is Outcome.FAULT
        assert "0x3210" in execution.message
        bench.robot.recover()
        assert bench.move(1.0).outcome is Outcome.SUCCEEDED


def test_late_statusword_only_takes_time(open_bench: OpenBench) -> None:
    with open_bench(status_delay_s=0.2) as bench:
        bench.robot.start()
        assert bench.move(2.0).outcome is Outcome.SUCCEEDED
        assert not bench.has_jumped()


# Motion of the drive itself


@pytest.mark.parametrize("method", [37, 34])
def test_homing_in_the_drive_moves_no_further(open_bench: OpenBench, method: int) -> None:
    speeds = {"homing_speed_rad_s": 1.0, "homing_creep_rad_s": 0.5}
    axis = {"homing_method": method, "homing_acceleration_rad_s2": 5.0, **speeds}
    with open_bench(axis=axis, encoder=4096, feed=4096) as bench:  # the next index is at 16384
        bench.robot.start()
        bench.robot.axes.home(0)
        assert bench.image.home_done[0]
        assert abs(bench.image.position[0]) < 0.05
        at = 15_000 if method == 37 else 16_384
        assert bench.drive["position"] == pytest.approx(at, abs=500)
        assert bench.move(0.2).outcome is Outcome.SUCCEEDED
        assert not bench.has_jumped()


@pytest.mark.parametrize("mode", ["pv", "csv"])
def test_velocity_command_and_the_way_back_to_positions(open_bench: OpenBench, mode: str) -> None:
    with open_bench(axis={"velocity_mode": mode}) as bench:
        bench.robot.start()
        bench.robot.axes.set_command_mode(0, CommandMode.VELOCITY)
        bench.robot.axes.jog([Jog(0, Profile(-0.5, 2.0, 2.0))])
        bench.drive.wait(lambda measured: measured["velocity"] == pytest.approx(-5000, rel=0.01))
        bench.robot.axes.stop([0])
        bench.until(lambda: not bench.image.operation[0])
        bench.robot.axes.set_command_mode(0, CommandMode.POSITION)
        assert bench.move(1.0).outcome is Outcome.SUCCEEDED
        assert not bench.has_jumped()


# SDO


def test_slow_responses_only_take_time(open_bench: OpenBench) -> None:
    with open_bench(sdo_delay_s=0.03) as bench:
        bench.robot.start()
        assert bench.move(2.0).outcome is Outcome.SUCCEEDED


def test_one_missing_response_is_asked_for_again(open_bench: OpenBench) -> None:
    with open_bench(sdo_missing=1) as bench:
        bench.robot.start()
        assert bench.drive["energised"]


@pytest.mark.parametrize(
    ("knobs", "object_"),
    [
        ({"sdo_missing": -1}, "0x1000"),
        ({"sdo_mute": (0x6502,)}, "0x6502"),
    ],
)
def test_missing_responses_end_the_start_with_node_and_object(
    open_bench: OpenBench, knobs: dict[str, object], object_: str
) -> None:
    with open_bench(**knobs) as bench:
        with pytest.raises(ConnectError) as failed:
            bench.robot.start()
        text = str(failed.value)
        assert f"node {NODE}" in text
        assert f"{object_}:00" in text
        assert "no answer within 0.3 s" in text


def test_store_that_takes_seconds_is_commanded_once(open_bench: OpenBench) -> None:
    with open_bench(store_s=1.5) as bench:
        arguments = ["canopen", "sdo", "write", *bench.bus, "--timeout", "5"]
        result = CliRunner().invoke(main, [*arguments, str(NODE), "0x1010", "1", SAVE])
        assert result.exit_code == 0, result.output
        assert bench.drive["counts"]["stores"] == 1


def test_one_turn_is_the_feed_constant(open_bench: OpenBench) -> None:
    with open_bench(feed=3600) as bench:
        result = CliRunner().invoke(main, ["canopen", "scan", *bench.bus, "--json"])
        [axis] = json.loads(result.output)["axes"]
        assert axis["counts_per_rad"] == pytest.approx(3600 / math.tau)


def test_duplicate_node_that_answers_after_the_start_is_not_energised(
    open_bench: OpenBench,
) -> None:
    with open_bench(duplicate_delay_s=0.8) as bench:
        with pytest.raises(RobotdError, match="duplicate node id"):
            bench.robot.start()
        assert not bench.drive["energised"]
        assert not bench.has_jumped()
