"""Starts with drives whose answers, objects or ids are not those of a plain one."""

from __future__ import annotations

import math
import re
from typing import Any

import pytest
from click.testing import CliRunner
from structlog.testing import capture_logs
from tests.plugins.independent.conftest import COUNTS_PER_RAD, NODE, START_RAD, OpenBench

from robotd.cli import main
from robotd.control.loop.setpoint_source import Outcome
from robotd.device.axes import Jog, Move
from robotd.device.state import CommandMode
from robotd.errors import ConnectError, DeviceTimeout
from robotd.motion.profile import Profile


def fault_of_node(bench: object) -> str:
    return str(bench.robot.fieldbus.status(0).nodes[0].fault)  # type: ignore[attr-defined]


@pytest.mark.parametrize("delay_s", [0.02, 0.1, 0.25])
def test_another_node_with_the_id_that_answers_late(open_bench: OpenBench, delay_s: float) -> None:
    with open_bench(duplicate_delay_s=delay_s) as bench:
        with pytest.raises(ConnectError, match=rf"node {NODE}.*\n?.*duplicate node id"):
            bench.robot.start()
        assert not bench.drive["energised"]


def test_heartbeats_of_two_nodes_are_noticed_in_operation(open_bench: OpenBench) -> None:
    with open_bench() as bench:
        bench.robot.start()
        assert fault_of_node(bench) == ""
        bench.drive.set(heartbeat_copies=2)
        bench.until(lambda: "probably a duplicate node id" in fault_of_node(bench))
        assert bench.robot.connection.ready
        assert bench.image.position[0] == pytest.approx(START_RAD, abs=1e-3)


def test_a_second_node_with_the_id_that_is_connected_in_operation(open_bench: OpenBench) -> None:
    with open_bench() as bench:
        bench.robot.start()
        bench.drive.set(duplicate_delay_s=0.1)
        bench.until(lambda: not bench.robot.connection.ready)  # its boot-up message
        with pytest.raises(ConnectError, match="duplicate node id"):
            bench.robot.recover()


OPTIONAL = (0x6007, 0x605A, 0x605D, 0x60C2, 0x1016, 0x6085)


def unwritten(lines: list[Any]) -> int:
    return sum(line["event"] == "object not written" for line in lines)


@pytest.mark.parametrize("rejection", ["ro", "abort"])
def test_optional_objects_that_cannot_be_written(open_bench: OpenBench, rejection: str) -> None:
    with capture_logs() as lines, open_bench(rejected=OPTIONAL, rejection=rejection) as bench:
        bench.robot.start()
        assert bench.move(2.0).outcome is Outcome.SUCCEEDED
        bench.robot.connection.stop_communication()
        bench.robot.connection.start_communication()
    assert unwritten(lines) == len(OPTIONAL), "once each"


def test_objects_that_the_descriptor_does_not_write(open_bench: OpenBench) -> None:
    axis = {"skip_writes": [f"0x{index:04X}" for index in OPTIONAL]}
    knobs = {"rejected": OPTIONAL, "rejection": "abort"}
    with capture_logs() as lines, open_bench(axis=axis, **knobs) as bench:
        bench.robot.start()
        assert bench.move(2.0).outcome is Outcome.SUCCEEDED
        assert not {f"{index:04X}:0" for index in OPTIONAL} & bench.drive["writes"].keys()
    assert unwritten(lines) == 0


@pytest.mark.parametrize("absent", [(), (0x6084,)])
def test_a_drive_with_one_ramp_stops_with_it(
    open_bench: OpenBench, absent: tuple[int, ...]
) -> None:
    with open_bench(absent=absent) as bench:
        bench.robot.start()
        bench.robot.axes.move([Move(0, 2.0, Profile(1.0, 2.0, 5.0))])
        ramp = int.from_bytes(bench.robot.fieldbus.read_object(0, NODE, 0x6083), "little")
        assert ramp == pytest.approx((5.0 if absent else 2.0) * COUNTS_PER_RAD, rel=0.01)
        bench.until(lambda: abs(float(bench.image.position[0]) - 2.0) < 1e-3)


@pytest.mark.parametrize("knobs", [{"supported_modes": 0}, {"absent": (0x6502,)}])
def test_a_drive_that_does_not_state_its_modes(
    open_bench: OpenBench, knobs: dict[str, object]
) -> None:
    with open_bench(axis={"check_modes": False}, **knobs) as bench:
        bench.robot.start()
        assert bench.move(2.0).outcome is Outcome.SUCCEEDED
    if "absent" not in knobs:
        with open_bench(**knobs) as bench, pytest.raises(ConnectError, match="check_modes: false"):
            bench.robot.start()


SAVE = 0x65766173
STORE = ["0x1010", "1", hex(SAVE), "--size", "4"]


@pytest.mark.parametrize("timeout_s", [0.3, 3.0])
def test_a_store_that_takes_a_second_is_sent_once(open_bench: OpenBench, timeout_s: float) -> None:
    with open_bench(store_s=1.0) as bench:
        command = ["canopen", "sdo", "write", *bench.bus, "--timeout", str(timeout_s)]
        result = CliRunner().invoke(main, [*command, str(NODE), *STORE])
        assert bench.drive["writes"]["1010:1"] == 1
        if timeout_s < 1.0:
            assert "may have been executed" in result.output
        else:
            assert result.exit_code == 0, result.output


def test_a_store_by_the_running_robot_is_sent_once(open_bench: OpenBench) -> None:
    with open_bench(store_s=1.0) as bench:
        bench.robot.start(enable=False)
        with pytest.raises(DeviceTimeout, match="may have been executed"):
            bench.robot.fieldbus.write_object(0, NODE, 0x1010, 1, SAVE.to_bytes(4, "little"))
        assert bench.drive["writes"]["1010:1"] == 1


def test_an_empty_string_is_named(open_bench: OpenBench) -> None:
    with open_bench(empty_strings=True) as bench:
        result = CliRunner().invoke(
            main, ["canopen", "sdo", "read", *bench.bus, str(NODE), "0x1008"]
        )
        assert result.output == "(empty)\n"


def test_an_alarm_without_a_code_is_told_by_statusword_and_register(open_bench: OpenBench) -> None:
    with open_bench(code_in_603f=False) as bench:
        bench.drive.do("fault", code=0x3210)  # its emergency is sent before robotd listens
        bench.drive.wait(lambda measured: measured["power"] == "FAULT")
        bench.robot.start(enable=False)
        bench.until(lambda: bool(bench.image.amp_alarm[0]))
        expected = r"no error code, statusword 0x\w{4} \(fault\), error register 0x\w\w \(generic"
        bench.until(lambda: bool(re.search(expected, bench.image.reason[0])))


# Mapping


def constant_axis(rpdos: dict[int, list[str]], tpdos: dict[int, list[str]]) -> dict[str, Any]:
    return {
        key: [{"number": number, "objects": objects} for number, objects in pdos.items()]
        for key, pdos in (("rpdos", rpdos), ("tpdos", tpdos))
    }


def test_constant_mapping_that_is_as_described(open_bench: OpenBench) -> None:
    rpdos = {2: ["0x6040", "0x6060"], 3: ["0x6040", "0x607A"]}
    tpdos = {2: ["0x6041", "0x6061"], 3: ["0x6041", "0x6064"], 4: ["0x6041", "0x606C"]}
    with open_bench(axis=constant_axis(rpdos, tpdos), fixed_mapping=True) as bench:
        bench.robot.start()
        assert bench.move(2.0).outcome is Outcome.SUCCEEDED
        assert not any(name.startswith(("16", "1A")) for name in bench.drive["writes"])
        assert not bench.has_jumped()


def test_constant_mapping_that_the_descriptor_does_not_describe(open_bench: OpenBench) -> None:
    with capture_logs() as lines, open_bench(axis={"tpdos": []}, fixed_mapping=True) as bench:
        bench.robot.start()
        assert bench.move(2.0).outcome is Outcome.SUCCEEDED
        assert math.isnan(bench.image.torque[0])
    [line] = [line for line in lines if line["event"] == "objects not in the default PDOs"]
    assert any(effect.startswith("0x603F: ") for effect in line["effects"])


def test_constant_mapping_that_is_not_as_described(open_bench: OpenBench) -> None:
    text = "RPDO 1 is constant and holds 0x6040:00: give these"
    with (
        open_bench(axis={"eds": None}, fixed_mapping=True) as bench,
        pytest.raises(ConnectError, match=text),
    ):
        bench.robot.start()


def test_default_pdos_without_an_object_that_the_eds_lacks(open_bench: OpenBench) -> None:
    with capture_logs() as lines, open_bench(axis={"tpdos": []}) as bench:
        bench.robot.start()
        assert bench.move(2.0).outcome is Outcome.SUCCEEDED
        assert not bench.has_jumped()
    assert ["0x60FD: limit and home switches read open"] in [line.get("effects") for line in lines]


# Values that no PDO holds


def test_a_stop_without_a_measured_velocity_ends_at_rest(open_bench: OpenBench) -> None:
    """The velocity is computed from positions; it was 0, and a stop ended at once."""
    tpdos = [{"number": 1, "objects": ["0x6041", "0x6061", "0x6064"]}]
    with open_bench(axis={"tpdos": tpdos}) as bench:
        bench.robot.start()
        axes, image = bench.robot.axes, bench.image
        axes.set_command_mode(0, CommandMode.VELOCITY)
        axes.jog([Jog(0, Profile(-0.8, 4.0, 0.8))])
        bench.drive.wait(lambda measured: measured["velocity"] < -0.79 * COUNTS_PER_RAD)
        bench.until(lambda: bool(image.velocity[0] < -0.7))
        axes.stop([0])
        bench.until(lambda: not image.operation[0])
        assert abs(bench.drive["velocity"]) < 0.1 * COUNTS_PER_RAD


# Pace


def test_slow_answers_end_the_start_with_the_step_and_what_to_do(open_bench: OpenBench) -> None:
    text = rf"node {NODE}\): .*SDO transfers took .* s each; raise engine.communication_timeout_s"
    with open_bench(sdo_delay_s=0.3, section={"sdo_timeout_s": 2.0}) as bench:
        with pytest.raises(ConnectError, match=text):
            bench.robot.start()
        assert not bench.drive["energised"]


@pytest.mark.parametrize("delay_s", [0.25, 1.0])
def test_slow_answers_only_take_time_where_the_time_outs_allow_them(
    open_bench: OpenBench, delay_s: float
) -> None:
    section, engine = {"sdo_timeout_s": 2 * delay_s}, {"communication_timeout_s": 200 * delay_s}
    with open_bench(sdo_delay_s=delay_s, section=section, engine=engine) as bench:
        with capture_logs() as logs:
            bench.robot.start()
        assert bench.drive["energised"]
        bench.move(START_RAD + 0.3)
        assert bench.drive["position"] == pytest.approx(1.8 * COUNTS_PER_RAD, abs=100)
    progress = [line for line in logs if line["event"] == "configuring takes long"]
    assert progress
    assert all(f"(node {NODE})" in line["step"] for line in progress)


def test_answers_that_come_after_the_time_out_are_named(open_bench: OpenBench) -> None:
    text = rf"node {NODE}\): identity: .*no answer within 0.3 s, it came after .* raise sdo_timeout"
    with open_bench(sdo_delay_s=0.5) as bench, pytest.raises(ConnectError, match=text):
        bench.robot.start()


# DCF


DCF = {"6065": "0x1000", "6067": "20", "607Dsub1": "-31000", "6040": "0x0F", "1017": "7"}


def test_values_of_a_dcf_are_written_where_they_differ(open_bench: OpenBench) -> None:
    with open_bench(axis={"dcf_values": True}, dcf=DCF) as bench:
        bench.robot.start()
        writes = bench.drive["writes"]
        assert writes["6065:0"] == writes["607D:1"] == 1
        assert "6067:0" not in writes, "the drive has this value"
        assert bench.robot.fieldbus.read_object(0, NODE, 0x6065, 0) == b"\0\x10\0\0"
        assert bench.move(2.0).outcome is Outcome.SUCCEEDED
        assert not bench.has_jumped()


def test_values_of_a_dcf_are_not_written_unless_the_descriptor_asks(open_bench: OpenBench) -> None:
    with open_bench(dcf=DCF) as bench:
        bench.robot.start()
        assert not {"6065:0", "607D:1"} & bench.drive["writes"].keys()


def test_a_value_of_a_dcf_that_the_drive_refuses_is_named(open_bench: OpenBench) -> None:
    knobs = {"rejected": (0x6065,), "rejection": "abort"}
    with (
        open_bench(axis={"dcf_values": True}, dcf=DCF, **knobs) as bench,
        pytest.raises(ConnectError, match="DCF values: writing 0x6065:00"),
    ):
        bench.robot.start()
