"""The independent drive against CiA 301, in simulated time: NMT, SDO, knobs and EDS."""

from __future__ import annotations

import ast
import struct
import sys
from pathlib import Path

import can
import canopen
import pytest
from tests.plugins.independent.canopen_device import Nmt
from tests.plugins.independent.canopen_objects import Abort
from tests.plugins.independent.cia402_node import State
from tests.plugins.independent.harness import ThreadedNode, duplicate
from tests.plugins.independent.node_bench import NODE, Bench, abort_of, booted, moving, rejected

pytestmark = pytest.mark.daily


@pytest.fixture
def bench() -> Bench:
    return booted()


# NMT, heartbeat, EMCY


def test_boots_into_pre_operational_and_announces_it_once() -> None:
    bench = Bench(boot_s=0.05)
    bench.send(0x600 + NODE, struct.pack("<BHB4x", 0x40, 0x1000, 0))
    bench.wait(0.04)
    assert not bench.frames
    bench.wait(0.1)
    assert bench.sent(0x700 + NODE) == [b"\0"]
    assert bench.drive.state is Nmt.PRE_OPERATIONAL


@pytest.mark.parametrize(
    ("command", "state"),
    [(0x01, Nmt.OPERATIONAL), (0x02, Nmt.STOPPED), (0x80, Nmt.PRE_OPERATIONAL)],
)
def test_obeys_nmt_commands(bench: Bench, command: int, state: Nmt) -> None:
    bench.nmt(command)
    assert bench.drive.state is state
    bench.send(0, bytes([0x80, NODE + 1]))
    assert bench.drive.state is state
    bench.send(0, bytes([0x80, 0]))
    assert bench.drive.state is Nmt.PRE_OPERATIONAL


def test_stopped_node_answers_no_sdo(bench: Bench) -> None:
    bench.nmt(2)
    bench.send(0x600 + NODE, struct.pack("<BHB4x", 0x40, 0x1000, 0))
    assert not bench.sent(0x580 + NODE)


@pytest.mark.parametrize(("command", "offset"), [(0x81, 0), (0x82, 100)])
def test_reset_communication_keeps_the_application(bench: Bench, command: int, offset: int) -> None:
    bench.write(0x607C, 0, 100)
    bench.write(0x1017, 0, 500, 2)
    bench.sent(0x700 + NODE)
    bench.nmt(command)
    bench.wait(0.1)
    assert bench.sent(0x700 + NODE) == [b"\0"]
    assert bench.read(0x1017) == 0
    assert bench.read(0x607C) == offset


def test_heartbeat_tells_the_state_each_period(bench: Bench) -> None:
    bench.sent(0x700 + NODE)
    bench.write(0x1017, 0, 100, 2)
    bench.wait(0.45)
    assert bench.sent(0x700 + NODE) == [b"\x7f"] * 5  # the first one at once
    bench.nmt(1)
    bench.drive.knobs.heartbeat_copies = 2
    bench.wait(0.5)
    assert bench.sent(0x700 + NODE) == [b"\x05"] * 10


def test_lost_heartbeat_after_the_first_one_is_a_fault(bench: Bench) -> None:
    bench.write(0x1016, 1, 0x7F << 16 | 200)
    bench.nmt(1)
    bench.enable(9)
    bench.wait(0.5)
    assert bench.drive.state is Nmt.OPERATIONAL
    bench.send(0x77F, b"\x05")
    bench.wait(0.19)
    assert bench.drive.power is State.ENABLED
    bench.wait(0.1)
    assert bench.drive.state is Nmt.PRE_OPERATIONAL
    assert bench.drive.power is State.FAULT
    assert struct.unpack("<HB5x", bench.sent(0x80 + NODE)[0])[0] == 0x8130


def test_one_node_is_consumed_once(bench: Bench) -> None:
    bench.write(0x1016, 1, 0x7F << 16 | 200)
    assert rejected(bench, 0x1016, 2, 0x7F << 16 | 300) == 0x0604_0043


def test_error_history_has_the_newest_first_and_can_be_cleared(bench: Bench) -> None:
    bench.drive.fault(0x3210, 4)
    bench.drive.emergency(0x4210, 8)
    assert bench.read(0x1003) == 2
    assert [bench.read(0x1003, sub) for sub in (1, 2)] == [0x4210, 0x3210]
    assert bench.read(0x1001) == 0x0D
    assert rejected(bench, 0x1003, 0, 1, 1) == 0x0609_0030
    bench.write(0x1003, 0, 0, 1)
    assert bench.read(0x1003) == 0


# SDO


@pytest.mark.parametrize(
    ("request_bytes", "code"),
    [
        (struct.pack("<BHB", 0x40, 0x5555, 0), 0x0602_0000),
        (struct.pack("<BHB", 0x40, 0x1018, 9), 0x0609_0011),
        (struct.pack("<BHBI", 0x23, 0x1000, 0, 1), 0x0601_0002),
        (struct.pack("<BHBI", 0x2B, 0x607C, 0, 1), 0x0607_0013),
        (struct.pack("<BHBI", 0x23, 0x6040, 0, 1), 0x0607_0012),
        (struct.pack("<BHBI", 0x2F, 0x6060, 0, 5), 0x0609_0030),
        (struct.pack("<BHBI", 0x2F, 0x6098, 0, 1), 0x0609_0030),
        (struct.pack("<BHBI", 0x23, 0x1010, 1, 1), 0x0800_0020),
        (b"\x60", 0x0504_0001),
        (b"\x00", 0x0504_0001),
        (struct.pack("<BHBI", 0xC2, 0x2000, 0, 4), 0x0504_0001),
    ],
    ids=lambda value: f"{value:08X}" if isinstance(value, int) else value.hex(),
)
def test_sdo_aborts(bench: Bench, request_bytes: bytes, code: int) -> None:
    assert abort_of(bench, request_bytes) == code


def test_segmented_upload_and_its_toggle_bit(bench: Bench) -> None:
    text = "a text that needs segments"
    upload = struct.pack("<BHB", 0x40, 0x2000, 0)
    assert bench.request(upload) == struct.pack("<BHBI", 0x41, 0x2000, 0, len(text))
    received, command = b"", 0x60
    while True:
        response = bench.request(bytes([command]))
        assert response[0] & 0x10 == command & 0x10
        received += response[1 : 8 - (response[0] >> 1 & 7)]
        if response[0] & 1:
            break
        command ^= 0x10
    assert received.decode() == text
    assert abort_of(bench, b"\x60") == 0x0504_0001
    bench.request(upload)
    bench.request(b"\x60")
    assert abort_of(bench, b"\x60") == 0x0503_0000


def test_segmented_download_and_its_announced_size(bench: Bench) -> None:
    download = struct.pack("<BHBI", 0x21, 0x2000, 0, 9)
    assert bench.request(download)[0] == 0x60
    assert bench.request(b"\x00abcdefg")[0] == 0x20
    assert bench.request(b"\x1bhi")[0] == 0x30
    assert bench.drive.objects[0x2000, 0].value == "abcdefghi"
    bench.request(download)
    assert abort_of(bench, b"\x01abcdefg") == 0x0607_0010


def test_empty_string_is_an_upload_of_no_bytes() -> None:
    bench = Bench(empty_strings=True)
    bench.wait(0.1)
    assert bench.request(struct.pack("<BHB", 0x40, 0x1008, 0))[4:] == b"\0\0\0\0"
    assert bench.request(b"\x60")[0] == 0x0F


def test_store_is_counted_and_survives_a_reset(bench: Bench) -> None:
    bench.drive.knobs.store_s = 3.0
    bench.write(0x607C, 0, 77)
    bench.send(0x600 + NODE, struct.pack("<BHBI", 0x23, 0x1010, 1, 0x65766173))
    bench.wait(2.9)
    assert not bench.sent(0x580 + NODE)
    bench.wait(0.2)
    assert bench.sent(0x580 + NODE)[0][0] == 0x60
    assert bench.drive.counts["stores"] == 1
    bench.nmt(0x81)
    bench.wait(0.1)
    assert bench.read(0x607C) == 77
    bench.write(0x1011, 1, 0x64616F6C)
    assert bench.read(0x607C) == 77
    bench.nmt(0x81)
    bench.wait(0.1)
    assert bench.read(0x607C) == 0


def test_responses_may_be_slow_missing_or_double() -> None:
    bench = Bench(sdo_delay_s=0.2, sdo_missing=1)
    bench.wait(0.1)
    request = struct.pack("<BHB4x", 0x40, 0x1000, 0)
    bench.send(0x600 + NODE, request)
    bench.wait(0.3)
    assert not bench.sent(0x580 + NODE)
    bench.send(0x600 + NODE, request)
    bench.wait(0.19)
    assert not bench.sent(0x580 + NODE)
    bench.wait(0.05)
    assert len(bench.sent(0x580 + NODE)) == 1
    bench.drive.knobs.duplicate_delay_s = 0.5
    twin = duplicate(bench.drive)
    twin.tick(bench.now + 0.1)
    assert twin.state is Nmt.PRE_OPERATIONAL
    assert twin[0x6064] == -5
    assert twin.answer_delay_s(0x1000, 0, False) == 0.5


def test_objects_may_be_rejected_or_absent() -> None:
    for rejection, code in (("ro", 0x0601_0002), ("abort", 0x0800_0022)):
        bench = Bench(rejected=(0x6007, 0x605A), rejection=rejection, absent=(0x6084, 0x6502))
        bench.wait(0.1)
        assert rejected(bench, 0x605A, 0, 6, 2) == code
        assert bench.read(0x605A) == 2
        with pytest.raises(Abort, match="0x06020000"):
            bench.read(0x6502)
        assert "[6084]" not in bench.drive.eds(NODE)
        assert bench.drive.writes["605A:0"] == 1


def test_restart_coasts_and_keeps_the_position(bench: Bench) -> None:
    bench.nmt(1)
    moving(bench)
    bench.sent(0x700 + NODE)
    bench.drive.restart()
    bench.wait(0.5)
    assert bench.sent(0x700 + NODE) == [b"\0"]
    assert bench.drive.state is Nmt.PRE_OPERATIONAL
    assert bench.drive.power is State.SWITCH_ON_DISABLED
    assert bench.drive.axis.position > 123_456


def test_shares_no_code_with_robotd() -> None:
    folder = Path(__file__).parent
    names = ("canopen_objects", "canopen_device", "servo_axis", "cia402_node", "knobs", "harness")
    for name in names:
        tree = ast.parse((folder / f"{name}.py").read_text(encoding="utf-8"))
        imported = [n.module or "" for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)]
        imported += [a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names]
        roots = {module.split(".")[0] for module in imported} - sys.stdlib_module_names
        assert roots <= {"can", "tests"}
        assert all(
            m.startswith("tests.plugins.independent") for m in imported if m.startswith("tests")
        )


def test_eds_describes_the_drive(tmp_path: Path) -> None:
    drive = Bench().drive
    path = tmp_path / "node.eds"
    path.write_text(drive.eds(NODE))
    dictionary = canopen.import_od(str(path), NODE)
    for (index, sub), entry in drive.objects.items():
        variable = dictionary.get_variable(index, sub)
        assert variable is not None
        assert variable.default == entry.default
        assert variable.access_type == entry.access
        assert variable.pdo_mappable == bool(entry.pdo)


def test_runs_in_a_thread_with_a_foreign_master() -> None:
    bus = can.Bus(interface="virtual", channel="independent-drive")
    network = canopen.Network()
    network.connect(interface="virtual", channel="independent-drive")
    with ThreadedNode(bus, NODE) as node:
        assert node["nmt"] == "PRE_OPERATIONAL"
        remote = network.add_node(NODE, canopen.ObjectDictionary())
        assert remote.sdo.upload(0x2000, 0) == b"a text that needs segments"
        remote.sdo.download(0x2000, 0, b"another text that needs them")
        assert remote.sdo.upload(0x2000, 0) == b"another text that needs them"
        node.set(heartbeat_copies=2)
        node.do("fault", code=0x3210)
        assert node["emergencies"] == [0x3210]
    network.disconnect()
