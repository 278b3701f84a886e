"""Fieldbus diagnostics: masters, slaves, registers and capabilities are checked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest
from tests.core.device.harness import ALL, Harness

from robotd.device.capabilities import Capability
from robotd.device.fieldbus import Fieldbus
from robotd.errors import InvalidArgument, NotReady, Unsupported


def test_the_network_is_told(harness: Harness) -> None:
    assert [slave.id for slave in harness.fieldbus.status(0).nodes] == [0, 1]


def test_a_status_that_another_reader_has_read_will_do_for_its_age(
    harness: Harness, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = harness.fieldbus_driver.status
    monkeypatch.setattr(harness.fieldbus_driver, "status", lambda bus: replace(read(bus)))
    newest = harness.fieldbus.status(0)
    assert harness.fieldbus.status(0, 3600.0) is newest
    assert harness.fieldbus.status(0) is not newest


def test_registers_are_read(harness: Harness) -> None:
    assert harness.fieldbus.read_register(0, 1, 0x0FFE, 2) == b"\xfe\xff"
    assert harness.fieldbus_driver.calls == [("read_register", 0, 1, 0x0FFE, 2)]


@pytest.mark.parametrize(
    ("slave", "address", "length", "text"),
    [
        (0, 0, 0, r"length 0 is outside 1\.\.4096"),
        (0, 0, 4097, r"length 4097 is outside 1\.\.4096"),
        (0, 0x0FFF, 2, r"registers 0x0fff\.\.0x1000 are outside 0x0000\.\.0x0fff"),
        (0, -1, 1, r"are outside 0x0000\.\.0x0fff"),
        (2, 0, 1, r"node 2 is not on bus 0 \(nodes: \[0, 1\]\)"),
        (-1, 0, 1, r"node -1 is not on bus 0"),
    ],
)
def test_registers_that_are_not_there_are_rejected(
    harness: Harness, slave: int, address: int, length: int, text: str
) -> None:
    with pytest.raises(InvalidArgument, match=text):
        harness.fieldbus.read_register(0, slave, address, length)
    assert harness.fieldbus_driver.calls == []


def test_objects_are_read_and_written(harness: Harness) -> None:
    harness.fieldbus.write_object(0, 1, 0x6083, 0, b"\x10\x27\0\0")
    assert harness.fieldbus.read_object(0, 1, 0x6083) == b"\x10\x27\0\0"
    assert harness.fieldbus_driver.calls == [
        ("write_object", 0, 1, 0x6083, 0, b"\x10\x27\0\0"),
        ("read_object", 0, 1, 0x6083, 0),
    ]


@pytest.mark.parametrize(
    ("node", "index", "subindex", "data", "text"),
    [
        (0, -1, 0, b"1", r"index -1 is outside 0\.\.0xffff"),
        (0, 0x10000, 0, b"1", r"index 65536 is outside"),
        (0, 0x6083, 256, b"1", r"subindex 256 is outside 0\.\.0xff"),
        (2, 0x6083, 0, b"1", r"node 2 is not on bus 0 \(nodes: \[0, 1\]\)"),
        (0, 0x6083, 0, b"", r"0 bytes of data are outside 1\.\.4096"),
    ],
)
def test_objects_that_cannot_be_are_rejected(
    harness: Harness, node: int, index: int, subindex: int, data: bytes, text: str
) -> None:
    with pytest.raises(InvalidArgument, match=text):
        harness.fieldbus.write_object(0, node, index, subindex, data)
    if data:
        with pytest.raises(InvalidArgument, match=text):
            harness.fieldbus.read_object(0, node, index, subindex)
    assert harness.fieldbus_driver.calls == []


def commands(fieldbus: Fieldbus, master: int) -> dict[Capability | None, Callable[[], object]]:
    return {
        None: lambda: fieldbus.status(master),
        Capability.REGISTER_READ: lambda: fieldbus.read_register(master, 0, 0, 1),
        Capability.STATISTICS: lambda: fieldbus.reset_statistics(master),
        Capability.HOT_CONNECT: lambda: fieldbus.start_hot_connect(master),
        Capability.OBJECTS: lambda: fieldbus.read_object(master, 0, 0x1000),
    }


@pytest.mark.parametrize("master", [-1, 1])
def test_another_master_is_rejected(harness: Harness, master: int) -> None:
    for command in commands(harness.fieldbus, master).values():
        with pytest.raises(InvalidArgument, match=rf"^bus {master} is outside 0\.\.0$"):
            command()
    assert harness.fieldbus_driver.calls == []


def test_nothing_is_asked_before_the_engine_is_ready() -> None:
    for command in commands(Harness().fieldbus, 0).values():
        with pytest.raises(NotReady):
            command()


@pytest.mark.parametrize(
    "missing",
    [
        Capability.REGISTER_READ,
        Capability.STATISTICS,
        Capability.HOT_CONNECT,
        Capability.OBJECTS,
    ],
)
def test_a_feature_that_the_backend_does_not_have_is_unsupported(missing: Capability) -> None:
    harness = Harness(capabilities=ALL - {missing}).make_ready()
    for needs, command in commands(harness.fieldbus, 0).items():
        if needs is missing:
            with pytest.raises(Unsupported, match="not supported by the fake backend"):
                command()
        else:
            command()


def test_a_backend_without_a_fieldbus_says_so(harness: Harness) -> None:
    for command in commands(Fieldbus(None, harness.connection, ALL, "fake"), 0).values():
        with pytest.raises(Unsupported, match="not supported by the fake backend"):
            command()
