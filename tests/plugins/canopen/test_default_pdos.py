"""Default PDOs by what an EDS offers."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from tests.plugins.canopen.network import drive, options, plan

from robotd.errors import DescriptorError
from robotd_canopen.layout import AxisLayout
from robotd_canopen.object_dictionary import GENERIC_DRIVE, eds_path
from robotd_cia402.object_numbers import ERROR_CODE, SWITCHES, TARGET_VELOCITY, TORQUE

Planned = Callable[..., AxisLayout]


@pytest.fixture
def planned(tmp_path: Path) -> Planned:
    """``planned(without, **changes)``: the axis by a generic EDS without some sections."""

    def made(
        without: str = "^$", axis: dict[str, object] | None = None, **changes: str
    ) -> AxisLayout:
        text = Path(eds_path(None, None, GENERIC_DRIVE)).read_text(encoding="utf-8")
        kept = []
        for original in re.split(r"\n(?=\[)", text):
            section = original
            name = section[1 : section.index("]")]
            if not re.match(without, name):
                for value in [value for key, value in changes.items() if re.match(key[1:], name)]:
                    key = value.partition("=")[0]
                    section = re.sub(rf"{key}=.*", value, section)
                kept.append(section)
        eds = tmp_path / "drive.eds"
        eds.write_text("\n".join(kept), encoding="utf-8")
        return plan(options(axes=[drive(0, eds=str(eds), **(axis or {})), drive(1)])).axes[0]

    return made


def objects(layout: AxisLayout) -> list[list[str]]:
    return [
        [f"{entry.index:04X}" for entry in pdo.entries] for pdo in (*layout.rpdos, *layout.tpdos)
    ]


def test_a_complete_eds(planned: Planned) -> None:
    layout = planned()
    assert objects(layout) == [
        ["6040", "6060", "607A"],
        ["60FF"],
        ["6041", "6061", "6064"],
        ["606C", "6077", "603F"],
        ["6062", "60FD"],
    ]
    assert [pdo.transmission for pdo in layout.tpdos] == [1, 1, 4]
    assert layout.left_out == ()


def test_optional_objects_that_are_missing_or_cannot_be_mapped(planned: Planned) -> None:
    layout = planned("60FD|6077|60FF", _603F="PDOMapping=0")
    assert objects(layout) == [
        ["6040", "6060", "607A"],
        ["6041", "6061", "6064"],
        ["606C"],
        ["6062"],
    ]
    assert set(layout.left_out) == {SWITCHES, TORQUE, TARGET_VELOCITY, ERROR_CODE}


def test_a_mode_that_cannot_be_mapped_goes_by_sdo(planned: Planned) -> None:
    layout = planned(_606="PDOMapping=0", _6064="PDOMapping=1")
    assert objects(layout)[:3] == [["6040", "607A"], ["60FF"], ["6041", "6064"]]
    assert {0x6060, 0x6061} <= set(layout.left_out)


@pytest.mark.parametrize(
    ("access", "text"),
    [("_6060", "0x6060 .*, and it cannot be written"), ("_6061", "0x6061 .* cannot be read")],
)
def test_a_mode_that_cannot_be_changed_at_all(planned: Planned, access: str, text: str) -> None:
    kind = "AccessType=ro" if access == "_6060" else "AccessType=wo"
    with pytest.raises(DescriptorError, match=text):
        planned(_606="PDOMapping=0", _6064="PDOMapping=1", **{access: kind})


def test_pdos_that_the_drive_does_not_have(planned: Planned) -> None:
    layout = planned("180[02]|1A0[02]|1401|1601")
    assert [pdo.name for pdo in (*layout.rpdos, *layout.tpdos)] == [
        *("RPDO 1", "RPDO 3", "TPDO 2", "TPDO 4")
    ]
    assert set(layout.left_out) == {0x6062, 0x60FD}


def test_mappings_with_room_for_two_objects(planned: Planned) -> None:
    layout = planned("1A0.sub[3-9A-F]")
    assert objects(layout)[2:] == [["6041", "6061"], ["6064"], ["606C", "6077"], ["603F"]]
    assert set(layout.left_out) == {0x6062, 0x60FD}


def test_an_eds_without_pdos_takes_the_predefined_ones(planned: Planned) -> None:
    assert [pdo.name for pdo in planned("1[468A]0").tpdos] == ["TPDO 1", "TPDO 2", "TPDO 3"]


def test_a_constant_mapping_is_taken_as_it_is(planned: Planned) -> None:
    layout = planned(
        _1A00sub0="DefaultValue=2",
        _1A00sub1="DefaultValue=0x60410010",
        _1A00sub2="DefaultValue=0x60640020",
        _1A01sub0="DefaultValue=2",
        _1A01sub1="DefaultValue=0x60410010",
        _1A01sub2="DefaultValue=0x60610008",
        _1A0="AccessType=const",
        _1800sub1="DefaultValue=$NODEID+0x190",
        _1800="AccessType=ro",
    )
    assert objects(layout)[2:] == [["6041", "6064"], ["6041", "6061"]]
    assert [pdo.cob_id for pdo in layout.tpdos] == [0x191, 0x281]
    assert [pdo.transmission for pdo in layout.tpdos] == [1, 1]


def test_rpdos_with_an_object_that_robotd_would_set_to_0_are_not_taken(planned: Planned) -> None:
    with pytest.raises(DescriptorError, match="no PDO holds 0x607A"):
        planned(
            _1600sub0="DefaultValue=2",
            _1600sub1="DefaultValue=0x607A0020",
            _1600sub2="DefaultValue=0x60720010",
            _160="AccessType=const",
        )


def test_pdos_that_are_not_the_constant_ones_of_the_eds(planned: Planned) -> None:
    given = {"tpdos": [{"number": 1, "objects": ["0x6041", "0x6061", "0x6064"]}]}
    with pytest.raises(DescriptorError, match=r"mapping as constant, with the objects 0x6041:0$"):
        planned(
            axis=given,
            _1A00sub0="DefaultValue=1",
            _1A00sub1="DefaultValue=0x60410010",
            _1A00="AccessType=const",
        )


def test_an_error_of_a_default_does_not_name_a_key(planned: Planned) -> None:
    with pytest.raises(DescriptorError) as caught:
        planned(_6064="PDOMapping=0")
    text = str(caught.value)
    assert "axes.0: default TPDO 1: object 0x6064:00" in text
    assert "tpdos.0" not in text
