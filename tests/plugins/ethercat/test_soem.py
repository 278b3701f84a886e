"""Errors of pysoem in the words of robotd; the tests in ``bus`` use the library itself."""

from __future__ import annotations

import errno
import socket
import sys
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pysoem
import pytest

from robotd.errors import ConnectError, DeviceTimeout, OperationError, PluginError
from robotd_cia402.drive_access import SdoAbort
from robotd_ethercat.al_status import AlState
from robotd_ethercat.soem import NO_ANSWER, MappingError, SlaveState, Soem


class Raising:
    """Stands for a slave of pysoem: each call raises ``error``."""

    def __init__(self, error: Exception) -> None:
        self.error = error
        self.callbacks: list[Any] = []

    def __getattr__(self, name: str) -> Any:
        def call(*_: object, **__: object) -> Any:
            raise self.error

        return call


def bus_of(error: Exception) -> Soem:
    bus = Soem(0.7)
    bus.slaves = [Raising(error)]
    return bus


def test_an_sdo_abort_has_its_code_and_text() -> None:
    bus = bus_of(pysoem.SdoError(1, 0x6064, 0, 0x06020000, "The object does not exist"))
    with pytest.raises(SdoAbort, match="abort 0x06020000, the object does not exist") as caught:
        bus.upload(0, 0x6064, 0)
    assert caught.value.code == 0x06020000


@pytest.mark.parametrize(
    ("error", "kind", "text"),
    [
        (pysoem.MailboxError(1, 5, "Header error"), OperationError, "mailbox error 5, Header"),
        (pysoem.WkcError(wkc=0), DeviceTimeout, "no answer of the mailbox within 0.7 s, 3 tries"),
        (pysoem.PacketError(1, 3), OperationError, "Data container too small"),
    ],
)
def test_other_failures_of_the_mailbox(error: Exception, kind: type[Exception], text: str) -> None:
    bus = bus_of(error)
    with pytest.raises(kind, match=text):
        bus.download(0, 0x6040, 0, b"\0\0")
    with pytest.raises(kind, match=text):
        bus.poll_mailbox(0)


def test_registers_without_an_answer() -> None:
    bus = bus_of(pysoem.WkcError())
    with pytest.raises(DeviceTimeout, match="register 0x0300: no answer"):
        bus.read_register(0, 0x0300, 2)
    with pytest.raises(DeviceTimeout, match="register 0x0300: no answer"):
        bus.write_register(0, 0x0300, b"\0")
    with pytest.raises(OperationError, match=r"watchdog_ms 20 was not taken: .*no answer, 3 tries"):
        bus.set_watchdog(0, 20.0)


def test_registers_are_not_asked_again_after_the_bus_was_closed() -> None:
    """The descriptor of its socket may be that of another file by then."""
    bus, asked = Soem(0.7), []

    def closed_meanwhile(*_: object) -> bytes:
        asked.append(1)
        bus.close()
        raise pysoem.WkcError

    bus.slaves = [SimpleNamespace(_fprd=closed_meanwhile)]
    with pytest.raises(OperationError, match="slave 0 is not there: the bus is closed"):
        bus.read_register(0, 0x0300, 2)
    assert len(asked) == 1


def test_a_watchdog_whose_first_frame_is_lost_is_written_again() -> None:
    bus = bus_of(pysoem.WkcError())
    written: list[float] = []

    def set_watchdog(kind: str, milliseconds: float) -> None:
        written.append(milliseconds)
        if len(written) == 1:
            raise pysoem.WkcError

    bus.slaves[0].set_watchdog = set_watchdog
    bus.set_watchdog(0, 20.0)
    assert written == [20.0, 20.0]


@pytest.mark.parametrize(("retry", "times"), [(False, 1), (True, 3)])
def test_a_command_without_an_answer_is_not_repeated(retry: bool, times: int) -> None:
    bus = bus_of(pysoem.WkcError())
    written: list[int] = []

    def sdo_write(index: int, *_: object, **__: object) -> None:
        written.append(index)
        raise pysoem.WkcError

    bus.slaves[0].sdo_write = sdo_write
    with pytest.raises(DeviceTimeout, match="3 tries" if retry else "may have been executed"):
        bus.download(0, 0x1010, 1, b"save", retry=retry)
    assert written == [0x1010] * times


@pytest.mark.parametrize(
    ("answer", "state"),
    [
        (b"\x08\0\0\0\0\0", SlaveState(AlState.OP, error=False, code=0)),
        (b"\x14\0\0\0\x1b\0", SlaveState(AlState.SAFE_OP, error=True, code=0x1B)),
        (b"\x28\0\0\0\0\0", SlaveState(AlState.OP, error=False, code=0)),
        (b"\x01\xff\x08\0\0\0", NO_ANSWER),  # process data of a late frame
        (b"\xfd\x01\x08\0\0\0", NO_ANSWER),
        (b"\x0f\0\x08\0\xc8\x03", NO_ANSWER),
    ],
)
def test_an_al_status_that_does_not_exist_is_no_answer(answer: bytes, state: SlaveState) -> None:
    bus = Soem(0.7)
    bus.slaves = [SimpleNamespace(_fprd=lambda *_: answer)]
    assert bus.states() == [state]


def test_slaves_behind_three_without_an_answer_are_not_asked() -> None:
    bus, asked = Soem(0.7), []

    def silent(*_: object) -> bytes:
        asked.append(1)
        raise pysoem.WkcError(wkc=0)

    bus.slaves = [SimpleNamespace(_fprd=silent)] * 100
    assert bus.states() == [NO_ANSWER] * 100
    assert len(asked) == 3


def test_errors_of_the_mapping_are_named_by_slave() -> None:
    errors = [pysoem.SdoError(2, 0x1C12, 0, 0x06010000, "Unsupported access"), ValueError("odd")]

    def fail() -> None:
        raise pysoem.ConfigMapError(errors)

    bus = Soem(0.7)
    bus._master = SimpleNamespace(config_map=fail)
    text = r"slave 1: abort 0x06010000, .*; ValueError: odd"
    with pytest.raises(MappingError, match=text) as caught:
        bus.map()
    assert caught.value.slaves == {1}


def test_emergencies_arrive_as_eight_bytes() -> None:
    raw = SimpleNamespace(callbacks=[])
    raw.add_emergency_callback = raw.callbacks.append
    bus, seen = Soem(0.7), []
    bus.slaves = [raw]
    bus.on_emergency(0, seen.append)
    raw.callbacks[0](pysoem.Emergency(1, 0x8611, 0x20, 1, 0x0302, 0x0504))
    assert seen == [bytes([0x11, 0x86, 0x20, 1, 2, 3, 4, 5])]


def test_an_interface_that_does_not_exist_is_named_with_the_others() -> None:
    with pytest.raises(
        ConnectError, match=r"there is no interface 'none7'.*available: .*lo"
    ) as caught:
        Soem(0.7).open("none7", None)
    assert caught.value.permanent


def test_without_rights_the_capability_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    made = socket.socket

    def refuse(*arguments: int, **named: int) -> socket.socket:
        if socket.AF_PACKET in arguments:
            raise PermissionError
        return made(*arguments, **named)

    monkeypatch.setattr(socket, "socket", refuse)
    bus = Soem(0.7)
    with pytest.raises(ConnectError, match="CAP_NET_RAW"):
        bus.open("lo", None)


def test_without_pysoem_its_installation_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pysoem", None)
    with pytest.raises(PluginError, match=r"needs pysoem.*pip install 'robotd\[ethercat\]'"):
        Soem(0.7)


LRW, BRD, FPRD = 12, 7, 4


def frame(command: int, number: int) -> bytes:
    return bytes(16) + bytes([command, number]) + bytes(42)


@pytest.fixture
def ends() -> Iterator[list[socket.socket]]:
    """Of two cables, to which the sockets of ``awaiting`` are connected."""
    pairs = [socket.socketpair(type=socket.SOCK_DGRAM) for _ in range(2)]
    yield [one for pair in pairs for one in pair]
    for one in [one for pair in pairs for one in pair]:
        one.close()


@pytest.mark.parametrize(
    ("frames", "there"),
    [
        ([frame(LRW, 3)], True),
        ([frame(FPRD, 3)], False),
        ([b""], False),
        ([frame(BRD, 3), frame(LRW, 3)], True),  # around the ring, each at the other end
        ([frame(LRW, 3), frame(BRD, 3)], True),  # back from the cut
        ([frame(BRD, 4), frame(LRW, 3)], False),  # another thread's
        ([frame(BRD, 3), frame(FPRD, 3)], False),
    ],
)
def test_process_data_are_awaited(
    ends: list[socket.socket], frames: list[bytes], there: bool
) -> None:
    bus = Soem(0.7)
    bus._sockets = ends[0 : 2 * len(frames) : 2]
    for end, data in zip(ends[1::2], frames, strict=False):
        if data:
            end.send(data)
    assert bus.await_process_data(0.001) is there


@pytest.mark.parametrize(("size", "there"), [(733, True), (734, False)])
def test_process_data_of_several_frames_are_not_awaited(
    ends: list[socket.socket], size: int, there: bool
) -> None:
    """SOEM would give up those that come after the first."""
    bus = Soem(0.7)
    bus._master = SimpleNamespace(config_map=lambda: None)
    bus.slaves = [SimpleNamespace(output=bytes(size), input=bytes(size))]
    bus.map()
    bus._sockets = ends[:1]
    ends[1].send(frame(LRW, 3))
    assert bus.await_process_data(0.001) is there


@pytest.mark.parametrize(("command", "late"), [(LRW, True), (FPRD, False)])
def test_answers_to_other_threads_make_no_process_data_late(
    ends: list[socket.socket], command: int, late: bool
) -> None:
    """After a loss under SDO traffic, frame after frame counted as lost."""
    bus = Soem(0.7)
    bus._sockets = [ends[0]]
    ends[0].setblocking(False)
    for number in range(2):
        ends[1].send(frame(command, number))
    assert bus.drop_late_frames() is late
    with pytest.raises(BlockingIOError):
        ends[0].recv(1)


@pytest.mark.parametrize("error", [BlockingIOError(), OSError(errno.ENETDOWN, "down")])
def test_a_frame_that_is_gone_when_it_is_looked_at_is_received_later(
    ends: list[socket.socket], error: OSError
) -> None:
    """Another thread takes it, or the interface goes down."""

    def fail(*_: object) -> bytes:
        raise error

    ends[1].send(b"frame")
    bus = Soem(0.7)
    bus._sockets = [SimpleNamespace(fileno=ends[0].fileno, recv=fail)]  # type: ignore[list-item]
    assert not bus.await_process_data(0.001)


def test_a_descriptor_that_is_too_large_for_select_ends_no_period() -> None:
    bus = Soem(0.7)
    bus._sockets = [SimpleNamespace(fileno=lambda: 1024)]  # type: ignore[list-item]
    assert not bus.await_process_data(0.001)


def test_a_frame_that_waits_in_the_interface_is_seen(ends: list[socket.socket]) -> None:
    """The kernel counts what the other end has not taken, as it counts an unsent frame."""
    bus = Soem(0.7)
    bus._sockets = [ends[0]]
    assert not bus.is_blocked
    ends[0].send(b"kept")  # as by a driver that frees sent frames late
    bus.note_all_sent()
    assert not bus.is_blocked
    ends[0].send(b"waits")
    assert bus.is_blocked
    ends[1].recv(10)
    ends[1].recv(10)
    assert not bus.is_blocked
