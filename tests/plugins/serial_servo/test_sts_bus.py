"""The simulated STS bus on its pseudo-terminal, with the maker's SDK and byte by byte."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from random import Random

import pytest
import scservo_sdk as sdk
import serial
from tests.plugins.serial_servo.polling import impatient, opened
from tests.plugins.serial_servo.sts_bus import StsBus, framed
from tests.plugins.serial_servo.sts_servo import Servo

GOAL, POSITION, TORQUE, LOCK = 42, 56, 40, 55
PROTOCOL = sdk.protocol_packet_handler()


@pytest.fixture
def bus() -> Iterator[StsBus]:
    with StsBus({key: Servo(angle=0.1 * key) for key in (1, 2, 3)}) as bus:
        yield bus


@pytest.fixture
def port(bus: StsBus) -> Iterator[sdk.PortHandler]:
    with opened(sdk, bus.port) as port:
        yield port


class Wire:
    """A client that sends and receives bytes."""

    def __init__(self, bus: StsBus, baud: int = 1_000_000) -> None:
        self.serial = serial.Serial(bus.port, baud, timeout=2)

    def ask(self, frame: bytes, count: int, timeout: float = 2) -> bytes:
        """Send ``frame`` and return up to ``count`` bytes."""
        self.serial.timeout = timeout
        self.serial.write(frame)
        return self.serial.read(count)

    def silent(self, frame: bytes) -> bool:
        return self.ask(frame, 1, 0.06) == b""


@pytest.fixture
def wire(bus: StsBus) -> Iterator[Wire]:
    wire = Wire(bus)
    yield wire
    wire.serial.close()


def eventually(condition: Callable[[], bool]) -> None:
    until = time.monotonic() + 5
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.005)


def ping(servo_id: int) -> bytes:
    return framed(servo_id, b"\1")


def read(servo_id: int, address: int, count: int) -> bytes:
    return framed(servo_id, bytes([2, address, count]))


def write(servo_id: int, address: int, *data: int) -> bytes:
    return framed(servo_id, bytes([3, address, *data]))


# The maker's SDK


def test_sdk_pings_reads_and_writes(bus: StsBus, port: sdk.PortHandler) -> None:
    assert PROTOCOL.ping(port, 1) == (777, 0, 0)
    with impatient(sdk):
        assert PROTOCOL.ping(port, 9)[1] == sdk.COMM_RX_TIMEOUT
    assert PROTOCOL.read2ByteTxRx(port, 2, POSITION) == (2048 + 130, 0, 0)
    assert PROTOCOL.write2ByteTxRx(port, 2, GOAL, 2200) == (0, 0)
    eventually(lambda: bus[2].reported() in range(2198, 2203))
    assert bus[2].writes[0].goal == 2200


def test_sdk_reads_and_writes_in_groups(bus: StsBus, port: sdk.PortHandler) -> None:
    group = sdk.GroupSyncRead(port, PROTOCOL, POSITION, 15)
    goals = sdk.GroupSyncWrite(port, PROTOCOL, GOAL, 2)
    for key in (3, 1, 2):
        assert group.addParam(key)
        assert goals.addParam(key, [0x34, 0x08])
    assert group.txRxPacket() == 0
    assert [group.getData(key, POSITION, 2) for key in (1, 2, 3)] == [2113, 2178, 2244]
    assert group.getData(1, 62, 1) == 120
    assert goals.txPacket() == 0
    eventually(lambda: all(servo.reported() in range(2098, 2103) for servo in bus.servos.values()))
    bus[1].supply_v = 15
    eventually(lambda: bus[1].get("status") == 1)
    assert PROTOCOL.read2ByteTxRx(port, 1, POSITION)[1:] == (0, 1)


def test_sdk_stages_a_write_until_action(bus: StsBus, port: sdk.PortHandler) -> None:
    assert PROTOCOL.regWriteTxRx(port, 1, GOAL, 2, [0, 9]) == (0, 0)
    assert PROTOCOL.read1ByteTxRx(port, 1, 64)[0] == 1
    assert bus[1].get("goal_position") == 0
    PROTOCOL.action(port, sdk.BROADCAST_ID)
    assert PROTOCOL.read2ByteTxRx(port, 1, GOAL)[0] == 2304
    assert PROTOCOL.read1ByteTxRx(port, 1, 64)[0] == 0


def test_sdk_changes_id_and_baud(bus: StsBus, port: sdk.PortHandler) -> None:
    for address, value in ((LOCK, 0), (5, 7)):
        assert PROTOCOL.write1ByteTxRx(port, 1, address, value) == (0, 0)
    assert PROTOCOL.ping(port, 7)[:2] == (777, 0)
    assert PROTOCOL.write1ByteTxRx(port, 7, 6, 4) == (0, 0)
    with opened(sdk, bus.port, 115_200) as slow:
        assert PROTOCOL.ping(slow, 7)[:2] == (777, 0)
        with impatient(sdk):
            assert PROTOCOL.ping(slow, 2)[1] == sdk.COMM_RX_TIMEOUT


@pytest.mark.parametrize(
    ("fault", "result"),
    [
        ("lose_request", sdk.COMM_RX_TIMEOUT),
        ("drop", sdk.COMM_RX_TIMEOUT),
        ("wrong_checksum", sdk.COMM_RX_CORRUPT),
        ("wrong_id", sdk.COMM_RX_TIMEOUT),
        ("split", sdk.COMM_SUCCESS),
        ("noise", sdk.COMM_SUCCESS),
    ],
)
def test_sdk_notices_faults(bus: StsBus, port: sdk.PortHandler, fault: str, result: int) -> None:
    bus[1].faults.force(fault)
    with impatient(sdk) if result == sdk.COMM_RX_TIMEOUT else nullcontext():
        assert PROTOCOL.readTxRx(port, 1, POSITION, 4)[1] == result
    port.ser.reset_input_buffer()
    assert PROTOCOL.read2ByteTxRx(port, 1, POSITION) == (2113, 0, 0)


# Bytes


def test_frames_and_silence(bus: StsBus, wire: Wire) -> None:
    assert wire.ask(bytes.fromhex("ff ff 01 02 01 fb"), 6) == bytes.fromhex("ff ff 01 02 00 fc")
    assert wire.ask(b"\0\xff" + read(2, POSITION, 2), 8) == framed(2, b"\0\x82\x08")
    assert wire.silent(ping(1)[:-1] + b"\0")
    assert wire.ask(ping(254), 18) == b"".join(framed(key, b"\0") for key in (1, 2, 3))
    assert wire.silent(write(254, TORQUE, 1))
    assert bus[1].get("torque") == bus[3].get("torque") == 1
    assert wire.silent(framed(1, b"\x0a"))


def test_reply_level_0_answers_reads_only(bus: StsBus, wire: Wire) -> None:
    bus[1].set("reply_level", 0)
    assert wire.silent(write(1, TORQUE, 1))
    assert wire.ask(read(1, TORQUE, 1), 7) == framed(1, b"\0\1")


def test_echo_comes_before_the_reply(bus: StsBus, wire: Wire) -> None:
    bus.knobs.echo = True
    assert wire.ask(ping(1), 12) == ping(1) + framed(1, b"\0")


def test_replies_take_their_time(bus: StsBus, wire: Wire) -> None:
    request = framed(254, bytes([0x82, POSITION, 15, 1, 2, 3]))
    begun = time.monotonic()
    assert len(wire.ask(request, 63)) == 63
    assert time.monotonic() - begun > (len(request) + 63) * 1e-5 + 3 * 500e-6
    bus.faults.force("delay")
    begun = time.monotonic()
    assert wire.ask(ping(1), 6) == framed(1, b"\0")
    assert time.monotonic() - begun > 0.1


@pytest.mark.parametrize(("after_missing", "count"), [("skip", 2), ("stop", 1)])
def test_sync_read_with_a_missing_servo(
    bus: StsBus, wire: Wire, after_missing: str, count: int
) -> None:
    bus.knobs.after_missing = after_missing
    bus[2].power_off()
    assert len(wire.ask(framed(254, bytes([0x82, POSITION, 2, 1, 2, 3])), 17, 0.2)) == count * 8


def test_two_servos_with_one_id_collide(bus: StsBus, wire: Wire) -> None:
    bus[2].set("id", 1)
    bus[1].set("return_delay", 0)
    bus[2].set("return_delay", 0)
    replies = {wire.ask(read(1, POSITION, 2), 8, 0.3) for _ in range(4)}
    assert framed(1, b"\0\x41\x08") not in replies
    assert framed(1, b"\0\x82\x08") not in replies
    assert b"" not in replies


def test_lost_power_silences_and_a_reboot_forgets(bus: StsBus, wire: Wire) -> None:
    wire.ask(write(1, GOAL, 0, 8), 6)
    bus[1].knobs.boot_s = 0.1
    bus[1].power_off()
    assert wire.silent(ping(1))
    bus[1].power_on()
    eventually(lambda: wire.ask(ping(1), 6, 0.1) == framed(1, b"\0"))
    assert wire.ask(read(1, TORQUE, 3), 9) == framed(1, bytes(4))


def test_unplugged_port_fails_and_returns_under_its_path(bus: StsBus) -> None:
    wire = Wire(bus)
    bus.unplug()
    with pytest.raises((serial.SerialException, OSError)):
        wire.ask(ping(1), 6)
    wire.serial.close()
    with pytest.raises(serial.SerialException):
        Wire(bus)
    bus.plug_in()
    wire = Wire(bus)
    assert wire.ask(ping(1), 6) == framed(1, b"\0")
    wire.serial.close()


def test_falsified_data_has_a_right_checksum(bus: StsBus, wire: Wire) -> None:
    bus[1].faults.force("falsify")
    reply = wire.ask(read(1, POSITION, 2), 8)
    assert reply == framed(1, reply[4:-1])
    assert reply != framed(1, b"\0\x41\x08")


def test_the_seed_decides_about_faults() -> None:
    def fates(seed: int) -> list[tuple[bytes, float]]:
        bus = StsBus({1: Servo()}, seed=seed)
        bus.faults.truncate = bus.faults.drop = bus.faults.delay = 0.3
        return [bus._with_faults(bus[1], framed(1, b"\0\1\2")) for _ in range(30)]

    assert fates(1) == fates(1)
    assert fates(1) != fates(2)
    assert {len(reply) for reply, _ in fates(1)} > {0, 8}
    assert {late for _, late in fates(1)} == {0, 0.1}


def test_any_request_with_a_right_checksum_is_survived() -> None:
    random = Random(1)
    bus = StsBus({key: Servo() for key in (1, 2)})
    for _ in range(300):
        instruction = random.choice([1, 2, 3, 4, 5, 6, 8, 0x82, 0x83, 0x99])
        data = random.randbytes(random.choice([0, 1, 2, 3, 4, 5, 9, 20]))
        device = random.choice([1, 2, 254, bus[1].id])
        bus.execute(framed(device, bytes([instruction]) + data), 0.0)
        bus[1].advance(bus[1].now + 0.01)
    assert all(math.isfinite(servo.joint.angle) for servo in bus.servos.values())


@pytest.mark.parametrize("fault", ["truncate", "corrupt"])
def test_damaged_replies(bus: StsBus, wire: Wire, fault: str) -> None:
    sound = framed(1, b"\0\x41\x08")
    bus[1].faults.force(fault)
    reply = wire.ask(read(1, POSITION, 2), 8, 0.2)
    assert reply != sound
    assert sound.startswith(reply) is (fault == "truncate")
