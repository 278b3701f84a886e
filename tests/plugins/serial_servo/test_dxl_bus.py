"""The simulated Dynamixel bus on its pseudo-terminal, with the maker's SDK."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from random import Random

import dynamixel_sdk as sdk
import pytest
from tests.plugins.serial_servo.dxl_bus import DxlBus, packet, status, unpacked
from tests.plugins.serial_servo.dxl_servo import ACCESS, RANGE, Servo
from tests.plugins.serial_servo.polling import impatient, opened

TORQUE, WATCHDOG, GOAL, CURRENT, POSITION = 64, 98, 116, 126, 132
PROTOCOL = sdk.PacketHandler(2.0)


@pytest.fixture
def bus() -> Iterator[DxlBus]:
    models = {1: "xl430-w250", 2: "xl330-m288", 3: "xm430-w350"}
    with DxlBus({key: Servo(model, angle=0.1 * key) for key, model in models.items()}) as bus:
        yield bus


@pytest.fixture
def port(bus: DxlBus) -> Iterator[sdk.PortHandler]:
    with opened(sdk, bus.port) as port:
        yield port


def eventually(condition: Callable[[], bool]) -> None:
    until = time.monotonic() + 5
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.005)


def test_packets_of_the_e_manual() -> None:
    assert packet(1, b"\1") == bytes.fromhex("ff ff fd 00 01 03 00 01 19 4e")
    assert status(1, 0, b"\x06\x04\x26")[-2:] == b"\x65\x5d"
    stuffed = packet(1, b"\3\x74\0\xff\xff\xfd\0")
    assert b"\xff\xff\xfd\xfd" in stuffed[7:]
    assert unpacked(stuffed) == b"\3\x74\0\xff\xff\xfd\0"


def test_pings_reads_and_writes(bus: DxlBus, port: sdk.PortHandler) -> None:
    assert PROTOCOL.ping(port, 1) == (1060, 0, 0)
    with impatient(sdk):
        assert PROTOCOL.ping(port, 9)[1] == sdk.COMM_RX_TIMEOUT
    assert PROTOCOL.read4ByteTxRx(port, 2, POSITION) == (2178, 0, 0)
    assert PROTOCOL.write1ByteTxRx(port, 2, TORQUE, 1) == (0, 0)
    assert PROTOCOL.write4ByteTxRx(port, 2, GOAL, 2300) == (0, 0)
    eventually(lambda: bus[2].reported() in range(2298, 2303))
    assert PROTOCOL.write1ByteTxRx(port, 2, 11, 4) == (0, ACCESS)


def test_broadcast_ping_is_answered_in_order_of_ids(bus: DxlBus, port: sdk.PortHandler) -> None:
    port.ser.timeout = 2
    port.writePort(packet(254, b"\1"))
    assert port.ser.read(42) == b"".join(
        status(key, 0, number.to_bytes(2, "little") + bytes([46]))
        for key, number in ((1, 1060), (2, 1200), (3, 1020))
    )


@pytest.mark.parametrize("fast", [False, True])
def test_sync_read_of_the_indirect_block(bus: DxlBus, port: sdk.PortHandler, fast: bool) -> None:
    group = sdk.GroupSyncRead(port, PROTOCOL, CURRENT, 10)
    for key in (3, 1, 2):
        assert group.addParam(key)
    assert (group.fastSyncRead() if fast else group.txRxPacket()) == sdk.COMM_SUCCESS
    assert [group.getData(key, POSITION, 4) for key in (1, 2, 3)] == [2113, 2178, 2244]
    bus[1].power_off()
    with impatient(sdk):
        assert (group.fastSyncRead() if fast else group.txRxPacket()) != sdk.COMM_SUCCESS


def test_group_writes_and_bulk_read(bus: DxlBus, port: sdk.PortHandler) -> None:
    goals = sdk.GroupSyncWrite(port, PROTOCOL, GOAL, 4)
    bulk_goals = sdk.GroupBulkWrite(port, PROTOCOL)
    bulk = sdk.GroupBulkRead(port, PROTOCOL)
    for key in (1, 2, 3):
        goals.addParam(key, (2000 + key).to_bytes(4, "little"))
        bulk.addParam(key, GOAL, 4)
    assert goals.txPacket() == 0
    bulk_goals.addParam(2, GOAL, 4, (2222).to_bytes(4, "little"))
    assert bulk_goals.txPacket() == 0
    assert bulk.txRxPacket() == 0
    assert [bulk.getData(key, GOAL, 4) for key in (1, 2, 3)] == [2001, 2222, 2003]
    assert bulk.fastBulkRead() == 0
    assert [bulk.getData(key, GOAL, 4) for key in (1, 2, 3)] == [2001, 2222, 2003]


def test_bytes_that_need_stuffing_arrive(bus: DxlBus, port: sdk.PortHandler) -> None:
    data = [0xFF, 0xFF, 0xFD, 0]
    assert PROTOCOL.writeTxRx(port, 1, 224, 4, data) == (0, 0)
    assert PROTOCOL.readTxRx(port, 1, 224, 4) == (data, 0, 0)


def test_staged_write_waits_for_action(bus: DxlBus, port: sdk.PortHandler) -> None:
    assert PROTOCOL.regWriteTxRx(port, 1, GOAL, 4, [0, 8, 0, 0]) == (0, 0)
    assert PROTOCOL.read1ByteTxRx(port, 1, 69)[0] == 1
    PROTOCOL.action(port, 1)
    eventually(lambda: bus[1].get("goal_position") == 2048)


def test_watchdog_counts_instructions_to_any_servo() -> None:
    bus = DxlBus({1: Servo(), 2: Servo()})
    for servo in bus.servos.values():
        servo.start(0.0)
    bus[1].write(TORQUE, b"\1")
    bus[1].write(WATCHDOG, b"\5")
    for step in range(20):
        bus[1].advance(step * 0.05)
        bus.execute(packet(2, b"\1"), 0.0)
    assert bus[1].get("bus_watchdog") == 5
    bus[1].advance(1.2)
    assert bus[1].get("bus_watchdog") == -1
    assert bus[1].write(GOAL, bytes(4)) == RANGE


def test_hardware_error_alerts_until_reboot(bus: DxlBus, port: sdk.PortHandler) -> None:
    PROTOCOL.write1ByteTxRx(port, 1, TORQUE, 1)
    bus[1].knobs.electrical_shock = True
    eventually(lambda: bus[1].get("torque") == 0)
    bus[1].knobs.electrical_shock = False
    assert PROTOCOL.read1ByteTxRx(port, 1, 70) == (0x10, 0, 0x80)
    assert PROTOCOL.reboot(port, 1) == (0, 0x80)
    with impatient(sdk):
        assert PROTOCOL.ping(port, 1)[1] == sdk.COMM_RX_TIMEOUT
    eventually(lambda: bus[1].answering)
    assert PROTOCOL.read1ByteTxRx(port, 1, 70) == (0, 0, 0)


def test_return_level_secondary_id_and_factory_reset(bus: DxlBus, port: sdk.PortHandler) -> None:
    assert PROTOCOL.write1ByteTxRx(port, 2, 12, 40) == (0, 0)
    PROTOCOL.write1ByteTxOnly(port, 40, 65, 1)
    eventually(lambda: bus[2].get("led") == 1)
    bus[1].set("return_level", 1)
    assert PROTOCOL.read1ByteTxRx(port, 1, TORQUE) == (0, 0, 0)
    with impatient(sdk):
        assert PROTOCOL.write1ByteTxRx(port, 1, TORQUE, 1)[0] == sdk.COMM_RX_TIMEOUT
    assert bus[1].get("torque") == 1
    assert PROTOCOL.factoryReset(port, 2, 2) == (0, 0)
    eventually(lambda: bus[2].answering)
    assert PROTOCOL.read1ByteTxRx(port, 2, 12) == (255, 0, 0)


@pytest.mark.parametrize(
    ("fault", "result"),
    [
        ("drop", sdk.COMM_RX_TIMEOUT),
        ("wrong_checksum", sdk.COMM_RX_CORRUPT),
        ("falsify", sdk.COMM_SUCCESS),
    ],
)
def test_faults(bus: DxlBus, port: sdk.PortHandler, fault: str, result: int) -> None:
    bus[1].faults.force(fault)
    with impatient(sdk) if result == sdk.COMM_RX_TIMEOUT else nullcontext():
        value, outcome, error = PROTOCOL.read4ByteTxRx(port, 1, POSITION)
    assert outcome == result
    assert (value, error) != (2113, 0)
    assert PROTOCOL.read4ByteTxRx(port, 1, POSITION) == (2113, 0, 0)


def test_any_request_with_a_right_checksum_is_survived() -> None:
    random = Random(1)
    bus = DxlBus({key: Servo() for key in (1, 2)})
    for _ in range(300):
        instruction = random.choice(
            [1, 2, 3, 4, 5, 6, 8, 0x10, 0x82, 0x83, 0x8A, 0x92, 0x93, 0x9A, 0x99]
        )
        data = random.randbytes(random.choice([0, 1, 2, 3, 4, 5, 9, 20]))
        device = random.choice([1, 2, 254, bus[1].id])
        bus.execute(packet(device, bytes([instruction]) + data), 0.0)
        bus[1].advance(bus[1].now + 0.01)
    assert all(math.isfinite(servo.joint.angle) for servo in bus.servos.values())
