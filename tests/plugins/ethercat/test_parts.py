"""AL codes, mapping, layout of process data, clocks, SII: the parts without a bus."""

from __future__ import annotations

import pytest

from robotd.errors import OperationError
from robotd_ethercat.al_status import AL_STATUS_CODES, AlState, al_code_text, al_state
from robotd_ethercat.bus_scan import process_data_sizes
from robotd_ethercat.clock_observer import ClockObserver
from robotd_ethercat.code_tables import AL_STATUS
from robotd_ethercat.fieldbus import PortCounters
from robotd_ethercat.mapping import (
    Assignment,
    Entry,
    Pdo,
    SlaveImage,
    entry_format,
    object_format,
    read_mapping,
    size_bytes,
    write_mapping,
)
from robotd_ethercat.options import PdoOptions


class Objects:
    """SDO transfers with a table."""

    def __init__(self, **values: bytes) -> None:
        self.values: dict[tuple[int, int], bytes] = {}
        self.order: list[tuple[int, int, int]] = []

    def upload(self, index: int, sub: int = 0) -> bytes:
        return self.values[index, sub]

    def download(self, index: int, sub: int, data: bytes) -> None:
        self.values[index, sub] = data
        self.order.append((index, sub, int.from_bytes(data, "little")))


def test_every_al_status_code_has_a_text() -> None:
    assert al_code_text(0x001B).startswith("AL status 0x001B: sync manager watchdog")
    assert al_code_text(0) == ""
    assert al_code_text(0x8001) == "AL status 0x8001: vendor specific, see the drive's manual"
    assert al_code_text(0x0999) == "AL status 0x0999: unknown"
    assert all(meaning for meaning, _ in AL_STATUS_CODES.values())
    assert AL_STATUS.line(0x001A) == "EtherCAT AL status 0x001A: synchronization error"
    assert AL_STATUS.advice(0x0050) == "start the communication again"


def test_al_states_have_the_error_flag_beside_them() -> None:
    assert al_state(0x14) is AlState.SAFE_OP
    assert al_state(0x07) is AlState.NONE
    assert AlState.PRE_OP.text == "PreOp"


def test_a_mapping_is_written_in_the_order_that_slaves_need() -> None:
    objects = Objects()
    objects.values[0x2222, 0] = bytes(3)
    pdos = [PdoOptions(index=0x1600, objects=("0x6040", "0x2222")), PdoOptions(index=0x1601)]
    write_mapping(objects, Assignment.OUTPUTS, pdos)
    assert objects.order == [
        (0x1C12, 0, 0),
        (0x1600, 0, 0),
        (0x1600, 1, 0x60400010),
        (0x1600, 2, 0x22220018),
        (0x1600, 0, 2),
        (0x1C12, 1, 0x1600),
        (0x1C12, 2, 0x1601),
        (0x1C12, 0, 2),
    ]
    objects.values[0x1601, 0] = bytes(1)
    read = read_mapping(objects, Assignment.OUTPUTS)
    assert read == [Pdo(0x1600, (Entry(0x6040, 0, 16), Entry(0x2222, 0, 24))), Pdo(0x1601, ())]
    assert size_bytes(read) == 5
    assert [str(entry) for entry in (*read[0].entries, Entry(0, 0, 8))] == [
        "0x6040:00 16 bit",
        "0x2222:00 24 bit",
        "gap of 8 bit",
    ]


def test_a_mapping_with_too_many_entries_is_rejected() -> None:
    objects = Objects()
    objects.values[0x1C12, 0] = b"\xff"
    with pytest.raises(OperationError, match="has 255 entries, at most 254"):
        read_mapping(objects, Assignment.OUTPUTS)


def test_gaps_and_odd_sizes_keep_their_place() -> None:
    image = SlaveImage()
    entries = Entry(0x6041, 0, 16), Entry(0, 0, 8), Entry(0x2222, 0, 24), Entry(0x6064, 0, 32)
    image.set_layout([Pdo(0x1600, (Entry(0x6040, 0, 16), Entry(0, 0, 4)))], [Pdo(0x1A00, entries)])
    image.take(b"\x37\x02" + bytes(4) + (-5).to_bytes(4, "little", signed=True))
    assert list(image.inputs) == [0x0237, -5]
    assert image.input_slots == {(0x6041, 0): 0, (0x6064, 0): 1}
    image.outputs[0] = 0x0F
    assert image.pack() == b"\x0f\x00\x00"
    assert (image.output_size, image.input_size) == (3, 10)


def test_an_object_inside_a_byte_is_rejected() -> None:
    entries = Entry(0, 0, 3), Entry(0x6041, 0, 16)
    with pytest.raises(OperationError, match="begins inside a byte, after 3 bit"):
        SlaveImage().set_layout([], [Pdo(0x1A00, entries)])


def test_types_of_objects() -> None:
    assert object_format(0x60C2, 1) == "B"
    assert object_format(0x60C2, 2) == "b"
    assert object_format(0x2000) is None
    assert entry_format(0x6064, 0, 16) == "H"  # mapped with another size than the profile's
    assert entry_format(0x2000, 0, 1) is None


def test_objects_of_every_axis_have_the_types_of_the_first() -> None:
    for axis in range(8):
        first = 0x800 * axis
        assert entry_format(0x607A + first, 0, 32) == "i"
        assert entry_format(0x6077 + first, 0, 16) == "h"
        assert object_format(0x6041 + first) == "H"
    assert object_format(0x1000) == "I"


def test_an_object_in_two_pdos_is_rejected() -> None:
    pdos = [Pdo(0x1601, (Entry(0x607A, 0, 32),)), Pdo(0x1602, (Entry(0x607A, 0, 32),))]
    with pytest.raises(OperationError, match=r"PDO 0x1602: .* is in another PDO, too"):
        SlaveImage().set_layout(pdos, [])


def test_phase_and_drift_of_the_bus_time() -> None:
    observer = ClockObserver(period_ns=2_000_000, shift_ns=100_000)
    for number in range(1200):
        own_ns = 10**12 + number * 2_000_000
        observer.observe(5 * 10**9 + round(number * 2_000_000 * 1.000_02), own_ns)
    assert observer.drift_ppm == pytest.approx(20, abs=0.1)
    assert observer.phase_ns == (5 * 10**9 + (1199 * 2_000_040) - 100_000) % 2_000_000
    assert 0 <= observer.lowest_ns <= observer.highest_ns < 2_000_000


def test_frames_that_are_late_by_chance_do_not_move_the_others_away_from_the_middle() -> None:
    """Every seventh frame is late by more than an eighth of a period."""
    period_ns = 2_000_000
    observer, punctual_ns, phases_ns = ClockObserver(period_ns, 0), period_ns // 4, []
    for number in range(5000):
        late_ns = 400_000 if number % 7 == 0 else 0
        observer.observe(punctual_ns + late_ns, (number + 1) * period_ns)
        punctual_ns = (punctual_ns + observer.shift_ns) % period_ns
        phases_ns.append(punctual_ns)
    assert phases_ns[2000:] == pytest.approx([period_ns // 2] * 3000, abs=20_000)


def test_sizes_by_the_sii() -> None:
    """Two PDOs, of which one has no sync manager, behind a category of another kind."""
    words = [*[0] * 0x40, 10, 2, 0x1111, 0x2222]
    assigned = bytes([0x00, 0x1A, 2, 3, 0, 0, 0, 0]) + 2 * bytes([0, 0x60, 1, 0, 0, 12, 0, 0])
    other = bytes([0x01, 0x1A, 1, 0xFF, 0, 0, 0, 0]) + bytes([0, 0x60, 1, 0, 0, 8, 0, 0])
    data = assigned + other
    words += [50, len(data) // 2]
    words += [int.from_bytes(data[at : at + 2], "little") for at in range(0, len(data), 2)]
    words += [0xFFFF, 0xFFFF]
    assert process_data_sizes(lambda word: words[word] | words[word + 1] << 16) == (0, 3)


def test_port_counters_without_errors_have_no_text() -> None:
    class Registers:
        def read_register(self, address: int, length: int) -> bytes:
            return bytes(length)

    assert PortCounters.read(Registers()).text == ""
