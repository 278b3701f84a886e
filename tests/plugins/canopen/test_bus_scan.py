"""Scanned nodes as sections of a robot."""

from __future__ import annotations

import math
from typing import Any

import pytest

from robotd.api import OperationError
from robotd_canopen.bus_scan import FoundNode, module_sizes, scan_sections
from robotd_canopen.options import CanopenOptions
from robotd_cia402.drive_scan import Read, read_axes
from robotd_cia402.modes import OperationMode

IDENTITY = (0x1234, 0x42, 1, 99)
CYCLIC = 0x1E5  # pp, pv, hm, ip, csp, csv


def reader(objects: dict[tuple[int, int], int]) -> Read:
    def read(index: int, sub: int) -> int:
        if (index, sub) not in objects:
            raise OperationError(f"no object 0x{index:04X}")
        return objects[index, sub]

    return read


def found(**keys: Any) -> FoundNode:
    about = {"number": 3, "name": "drive", "identity": IDENTITY, "state": "pre_operational"}
    return FoundNode(**about | keys)


def test_a_drive_states_its_modes_and_its_scale() -> None:
    (axis,) = read_axes(
        reader({(0x6502, 0): CYCLIC, (0x608F, 1): 4096, (0x608F, 2): 1,
                (0x6091, 1): 50, (0x6091, 2): 1})
    )  # fmt: skip
    assert OperationMode.CYCLIC_POSITION in axis.modes
    assert axis.counts_per_turn == 204_800
    section = found().axis_section(axis)
    assert section == {
        "node": 3,
        "identity": {"vendor_id": 0x1234, "product_code": 0x42},
        "stream_mode": "csp",
        "velocity_mode": "pv",
        "counts_per_rad": pytest.approx(204_800 / (2 * math.pi)),
    }


FEED_OF_3600 = {(0x608F, 1): 1 << 22, (0x608F, 2): 1, (0x6092, 1): 3600, (0x6092, 2): 1}


def test_the_feed_constant_is_one_turn_and_a_disagreement_is_told() -> None:
    """CiA 402-2: position = internal · 0x6092 / (0x608F · 0x6091); some drives ignore 0x6092."""
    (axis,) = read_axes(reader({(0x6502, 0): CYCLIC, **FEED_OF_3600}))
    section = found().axis_section(axis)
    assert section["counts_per_rad"] == pytest.approx(3600 / (2 * math.pi))
    assert section["remark"] == (
        "scale in doubt, the drive states for a turn 3600 (0x6092), 4194304 (0x608F x 0x6091):"
        " measure it"
    )


@pytest.mark.parametrize("feed", [0, 1, 1 << 22])
def test_a_feed_constant_that_says_nothing_else_is_no_disagreement(feed: int) -> None:
    """1 is the default of drives that count increments."""
    (axis,) = read_axes(reader({(0x6502, 0): CYCLIC, **FEED_OF_3600, (0x6092, 1): feed}))
    assert axis.counts_per_turn == 1 << 22
    assert "remark" not in found().axis_section(axis)


def test_a_drive_without_scale_or_csp() -> None:
    (axis,) = read_axes(reader({(0x6502, 0): 0b1_0110_0001 & ~0x80}))  # pp, hm, ip, csv
    section = found().axis_section(axis)
    assert (section["stream_mode"], section["velocity_mode"]) == ("ip", "csv")
    assert "counts_per_rad" not in section


def test_the_axes_of_one_drive_have_offsets() -> None:
    axes = read_axes(reader({(0x6502, 0): CYCLIC, (0x6D02, 0): CYCLIC}))
    sections = [found().axis_section(axis) for axis in axes]
    assert [section.get("axis_offset") for section in sections] == [None, 1]


def test_the_sections_are_valid_options() -> None:
    axes = read_axes(reader({(0x6502, 0): CYCLIC, (0x608F, 1): 4096, (0x608F, 2): 1}))
    sizes = module_sizes(reader({(0x6000, 0): 2, (0x6200, 0): 1}))
    nodes = [
        found(number=1, profile=402, axes=axes),
        found(number=16, profile=401, name="I/O", sizes=sizes),
    ]
    scan = scan_sections(nodes, "udp_multicast", "239.0.0.1#4000", 500_000)
    section = {"axes": [{"axis": 0, **scan["axes"][0]}], "io": scan["io"], **scan["options"]}
    options = CanopenOptions.model_validate(section)
    assert (options.bus.channel, options.bus.options) == ("239.0.0.1", {"port": 4000})
    assert options.sync_period_s == 0.002
    assert (options.io[0].input_length, options.io[0].output_length) == (2, 1)
