"""Mailbox, SDO transfers and SDO information of the simulated slaves."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.plugins.ethercat.line_master import (
    INBOX,
    MAILBOX,
    OUTBOX,
    SAFE_OP,
    LineMaster,
    master_of,
)
from tests.plugins.ethercat.sdo_client import Aborted, SdoClient

from robotd_ethercat.simulated import registers as reg
from robotd_ethercat.simulated.datagrams import Command
from robotd_ethercat.simulated.fault_commands import inject

VALUE, LONG, PDO, ASSIGNMENT = 0x2000, 0x2001, 0x1600, 0x1C12
UPLOAD = struct.pack("<HBHB4x", 2 << 12, 0x40, VALUE, 0)
SM0_STATUS, SM1_STATUS, SM1_ACTIVATE = 0x0805, 0x080D, 0x080E


@pytest.fixture
def master() -> LineMaster:
    master = master_of(1)
    master.pre_op(0)
    return master


@given(data=st.binary(min_size=1, max_size=512), data_bytes=st.integers(1, MAILBOX - 16))
def test_data_of_any_length_comes_back(data: bytes, data_bytes: int) -> None:
    master = master_of(1)
    master.pre_op(0)
    client = SdoClient(master)
    client.download(LONG, 0, data, data_bytes=data_bytes)
    assert client.upload(LONG, 0) == data


@given(request=st.binary(max_size=MAILBOX - 6), kind=st.integers(0, 15))
def test_random_messages_leave_the_server_usable(request: bytes, kind: int) -> None:
    master = master_of(1)
    master.pre_op(0)
    for service in (b"", struct.pack("<H", 2 << 12), struct.pack("<H", 8 << 12)):
        master.mailbox_send(0, (service + request)[: MAILBOX - 6], kind)
        while master.mailbox_receive(0) is not None:
            pass
    client = SdoClient(master)
    client.download(VALUE, 0, b"\1\2\3\4")
    assert client.upload(VALUE, 0) == b"\1\2\3\4"


@pytest.mark.parametrize(
    ("index", "sub", "data", "code"),
    [
        (0x5555, 0, b"\0", 0x06020000),
        (VALUE, 1, b"\0", 0x06090011),
        (0x1000, 0, bytes(4), 0x06010002),
        (VALUE, 0, bytes(2), 0x06070013),
        (VALUE, 0, bytes(5), 0x06070012),
        (LONG, 0, bytes(513), 0x06070012),
        (PDO, 1, bytes(4), 0x06010003),  # subindex 0 is not 0
        (ASSIGNMENT, 0, b"\x09", 0x06040042),
    ],
)
def test_downloads_that_are_aborted(
    master: LineMaster, index: int, sub: int, data: bytes, code: int
) -> None:
    with pytest.raises(Aborted) as aborted:
        SdoClient(master).download(index, sub, data)
    assert aborted.value.code == code


def test_a_mapping_takes_mappable_objects_alone(master: LineMaster) -> None:
    client = SdoClient(master)
    client.download(PDO, 0, b"\0")
    with pytest.raises(Aborted) as wrong:
        client.download(PDO, 1, struct.pack("<I", 0x6000_0120))  # an input
    assert wrong.value.code == 0x06040041
    client.download(PDO, 1, struct.pack("<I", 0x7000_0220))
    client.download(PDO, 2, struct.pack("<I", 8))  # a gap of 8 bits
    client.download(PDO, 0, b"\2")
    assert client.upload(PDO, 0) == b"\2"
    with pytest.raises(Aborted):
        client.download(ASSIGNMENT, 1, b"\xff\x17")


def test_a_mapping_is_fixed_from_safe_op_on() -> None:
    master = master_of(1)
    master.safe_op(0)
    with pytest.raises(Aborted) as aborted:
        SdoClient(master).download(PDO, 0, b"\0")
    assert aborted.value.code == 0x08000022


def test_complete_access(master: LineMaster) -> None:
    client = SdoClient(master)
    identity = client.upload(0x1018, 0, complete=True)
    assert struct.unpack("<BxIIII", identity)[:3] == (4, 0x52424F54, 1)
    assert client.upload(0x1018, 1, complete=True) == identity[2:]
    client.download(PDO, 0, struct.pack("<BxI", 1, 0x7000_0220), complete=True)
    assert client.upload(PDO, 0) == b"\1"
    assert client.upload(PDO, 1) == struct.pack("<I", 0x7000_0220)
    with pytest.raises(Aborted):
        client.upload(0x1018, 2, complete=True)


def test_a_wrong_toggle_bit_ends_the_transfer(master: LineMaster) -> None:
    client = SdoClient(master)
    client.request(struct.pack("<BHB4x", 0x40, LONG, 0))
    client.request(b"\x60" + bytes(7))
    with pytest.raises(Aborted) as aborted:
        client.request(b"\x60" + bytes(7))
    assert aborted.value.code == 0x05030000


def test_the_mailbox_handshake(master: LineMaster) -> None:
    slave = master.line.slaves[0]
    assert master.do(Command.APRD, 0, INBOX, bytes(MAILBOX)).counter == 0  # empty
    assert master.do(Command.APWR, 0, OUTBOX + 1, b"\0").counter == 0  # not from its start
    slave.controller.sync_managers[0].full = True
    assert master.mailbox_send(0, UPLOAD) == 0  # full
    slave.controller.sync_managers[0].full = False
    assert master.mailbox_send(0, UPLOAD) == 1
    assert master.read(0, SM1_STATUS, 1) & 8
    assert master.mailbox_receive(0) is not None
    assert not master.read(0, SM1_STATUS, 1) & 8


def test_a_lost_answer_is_repeated(master: LineMaster) -> None:
    master.mailbox_send(0, UPLOAD)
    first = master.mailbox_receive(0)
    assert master.mailbox_receive(0) is None
    master.write(0, SM1_ACTIVATE, b"\x03")  # toggle the repeat request
    assert master.read(0, SM1_ACTIVATE + 1, 1) & 2  # acknowledged
    assert master.mailbox_receive(0) == first
    assert first is not None


def test_unknown_protocols_and_broken_headers_are_rejected(master: LineMaster) -> None:
    master.mailbox_send(0, b"\0\0", kind=4)  # FoE
    assert master.mailbox_receive(0) == (0, struct.pack("<HH", 1, 2))
    master.mailbox_send(0, b"\0")
    assert master.mailbox_receive(0) == (0, struct.pack("<HH", 1, 6))


def test_emergencies_wait_for_the_mailbox(master: LineMaster) -> None:
    assert inject(master.line, "0 emcy 0x3210") == "ok"
    assert inject(master.line, "0 emcy 0") == "ok"
    master.line.tick(master.now_ns)
    codes = []
    for _ in range(2):
        kind, data = master.mailbox_receive(0) or (0, b"")
        assert (kind, data[1] >> 4) == (3, 1)
        codes.append(int.from_bytes(data[2:4], "little"))
    assert codes == [0x3210, 0]


def test_faults_of_objects_and_mailbox(master: LineMaster) -> None:
    client = SdoClient(master)
    inject(master.line, "0 abort 0x2000 0x08000020")
    with pytest.raises(Aborted) as aborted:
        client.upload(VALUE, 0)
    assert aborted.value.code == 0x08000020
    inject(master.line, "0 heal")
    for fault in ("0 timeout 0x2000", "0 mailbox silent"):
        inject(master.line, fault)
        master.mailbox_send(0, UPLOAD)
        assert master.mailbox_receive(0) is None
        inject(master.line, "0 heal")
    assert client.upload(VALUE, 0) == bytes(4)


def information(master: LineMaster, opcode: int, data: bytes) -> tuple[int, bytes]:
    """Exchange an SDO information request; return opcode and data of all fragments."""
    master.mailbox_send(0, struct.pack("<HBxH", 8 << 12, opcode, 0) + data)
    found = b""
    while (answer := master.mailbox_receive(0)) is not None:
        _, response = answer
        found += response[6:]
        if not response[2] & 0x80:
            return response[2], found
    raise AssertionError("incomplete")


def test_information_about_the_objects(master: LineMaster) -> None:
    indices = sorted(master.line.slaves[0].objects.objects)
    opcode, found = information(master, 1, struct.pack("<H", 1))
    assert (opcode, list(struct.unpack(f"<H{len(indices)}H", found))) == (2, [1, *indices])
    assert struct.unpack("<H5H", information(master, 1, bytes(2))[1])[1] == len(indices)
    opcode, found = information(master, 3, struct.pack("<H", 0x1018))
    assert (opcode, found) == (4, struct.pack("<HHBB", 0x1018, 0x23, 4, 9) + b"Identity")
    opcode, found = information(master, 5, struct.pack("<HBB", 0x1018, 1, 0))
    assert (opcode, found) == (6, struct.pack("<HBBHHH", 0x1018, 1, 0, 7, 32, 7) + b"Vendor ID")
    for request in ((3, b"\x55\x55"), (5, b"\x55\x55\0\0"), (5, b"\x18\x10\x09\0"), (1, b"\x09\0")):
        assert information(master, *request)[0] == 7


def test_the_mailbox_is_empty_after_init(master: LineMaster) -> None:
    master.mailbox_send(0, UPLOAD)
    master.request(0, 1)
    assert not master.read(0, SM1_STATUS, 1) & 8
    assert master.request(0, SAFE_OP)[1] == 0x11


def test_init_has_no_mailbox() -> None:
    master = master_of(1)
    assert master.request(0, 2) == (0x11, 0x16)
    assert master.mailbox_send(0, UPLOAD) == 1  # memory without a SyncManager
    assert not master.read(0, SM0_STATUS, 1)
    assert master.read(0, reg.AL_STATUS_CODE) == 0x16
