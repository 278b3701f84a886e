"""Values of DCF files, and the report of ``robotd canopen eds``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from tests.plugins.canopen.network import drive, options, plan

from robotd.cli import main
from robotd.cli.exit_codes import ExitCode
from robotd.errors import DescriptorError
from robotd_canopen.object_dictionary import GENERIC_DRIVE, DcfValue, dcf_values, eds_path, read_eds

HEAD = """
[DeviceComissioning]
NodeID=5
[2000]
ParameterName=Gains
ObjectType=0x8
DataType=0x0008
AccessType=rw
CompactSubObj=2
[2000Value]
NrOfEntries=2
1=0.5
2=0x3F800000
[2001]
ParameterName=Name
DataType=0x0009
AccessType=rw
ParameterValue=left
[2002]
ParameterName=Offset
DataType=0x0003
AccessType=wo
ParameterValue=-5
"""


def write_dcf(folder: Path, addition: str = HEAD, **values: str) -> Path:
    text = Path(eds_path(None, None, GENERIC_DRIVE)).read_text(encoding="utf-8")
    for key, value in values.items():
        text = text.replace(f"[{key[1:]}]\n", f"[{key[1:]}]\nParameterValue={value}\n")
    path = folder / "drive.dcf"
    path.write_text(text + addition, encoding="utf-8")
    return path


def values_of(path: Path) -> dict[tuple[int, int], DcfValue]:
    return {(value.index, value.sub): value for value in dcf_values(read_eds(path, 5))}


def test_values_as_they_are_transferred(tmp_path: Path) -> None:
    found = values_of(write_dcf(tmp_path, _6065="$NODEID+0x10", _605A="-1"))
    assert found[0x6065, 0].data == b"\x15\0\0\0"
    assert found[0x605A, 0].data == b"\xff\xff"
    assert found[0x2000, 1].data == b"\0\0\0\x3f"
    assert found[0x2000, 2].data == b"\0\0\x80\x3f", "the bits of 1.0"
    assert found[0x2002, 0].data == b"\xfb\xff"
    assert not found[0x2002, 0].is_readable
    assert not any(value.skipped for key, value in found.items() if key != (0x2001, 0))


@pytest.mark.parametrize(
    ("section", "reason"),
    [
        ("6041", "read-only"),
        ("1A00sub1", "configured by robotd"),
        ("1010sub1", "configured by robotd"),
        ("6040", "a command"),
        ("607A", "a command"),
    ],
)
def test_values_that_are_not_written(tmp_path: Path, section: str, reason: str) -> None:
    path = write_dcf(tmp_path, "", **{f"_{section}": "1"})
    if f"[{section}]" in path.read_text(encoding="utf-8"):
        [value] = values_of(path).values()
        assert reason in value.skipped


def test_a_value_that_is_no_number(tmp_path: Path) -> None:
    with pytest.raises(DescriptorError, match=r"\[6065\] ParameterValue: 'lots' is not a number"):
        read_eds(write_dcf(tmp_path, _6065="lots"), 5)


@pytest.mark.parametrize(
    ("keys", "values", "what"),
    [
        ({"node": 5}, {"_605A": "70000"}, "ParameterValue 70000 does not fit in 2 bytes"),
        ({"node": 4}, {"_605A": "1"}, "is the DCF of node 5, this is node 4"),
        ({"node": 5, "eds": None}, {}, "the generic EDS has a ParameterValue"),
    ],
)
def test_files_whose_values_cannot_be_written(
    tmp_path: Path, keys: dict[str, Any], values: dict[str, str], what: str
) -> None:
    path = write_dcf(tmp_path, **values)
    axis = {"eds": str(path), "dcf_values": True, **keys}
    with pytest.raises(DescriptorError, match=what):
        plan(options(axes=[drive(0, **axis), drive(1)]))


def test_the_report_of_a_dcf(tmp_path: Path) -> None:
    path = write_dcf(tmp_path, _6065="500", _6040="15")
    result = CliRunner().invoke(main, ["canopen", "eds", str(path), "--node", "5"])
    assert result.exit_code == 0, result.output
    for line in (
        "identity: {product_code: 0x402, revision: 0x10000}",
        "made for node 5",
        "TPDO 3, COB-ID 0x385, each 4 SYNC: 0x6062:00 (Position demand value), 0x60FD:00",
        "dcf_values: true writes 4 of 6 values",
        "  0x6065:00 (Following error window) = 500\n",
        "  0x6040:00 (Controlword) = 15: a command",
    ):
        assert line in result.output


def test_the_report_of_a_file_that_a_drive_cannot_use(tmp_path: Path) -> None:
    path = write_dcf(tmp_path, "")
    text = path.read_text(encoding="utf-8").replace("[6060]", "[6660]")
    path.write_text(text, encoding="utf-8")
    result = CliRunner().invoke(main, ["canopen", "eds", str(path)])
    assert result.exit_code == ExitCode.CONFIGURATION
    assert "object 0x6060 is not in the EDS" in result.output


def test_the_report_of_a_module_and_of_another_device(tmp_path: Path) -> None:
    module = eds_path(None, None, "generic_401.eds")
    result = CliRunner().invoke(main, ["canopen", "eds", str(module)])
    assert "output_length: 8" in result.output
    other = tmp_path / "other.eds"
    other.write_text("[1000]\nDataType=7\nDefaultValue=0x196\n", encoding="utf-8")
    result = CliRunner().invoke(main, ["canopen", "eds", str(other)])
    assert "device type 0x1000 is CiA 406, that of a drive is CiA 402" in result.output


def test_the_report_of_a_drive_with_constant_rpdos_and_few_objects() -> None:
    path = Path(__file__).parent / "eds" / "small.dcf"
    result = CliRunner().invoke(main, ["canopen", "eds", str(path), "--node", "5"])
    assert result.exit_code == ExitCode.CONFIGURATION  # it states no velocity mode
    for line in (
        "RPDO 1, COB-ID 0x205, each SYNC: 0x6040:00 (Controlword), 0x6060:00",
        "not in the PDOs: 0x606C:00: the velocity is computed from positions",
        "not written, missing or read-only: 0x1016, 0x6007",
        "dcf_values: true writes 3 of 4 values",
        "0x1017 (heartbeat) is not in the EDS: set heartbeat: false",
        "  0x2000:02 (Gains 2) = 1065353216\n",
    ):
        assert line in result.output


def test_a_file_that_states_no_modes_says_what_the_start_does(tmp_path: Path) -> None:
    text = Path(eds_path(None, None, GENERIC_DRIVE)).read_text(encoding="utf-8")
    path = tmp_path / "drive.eds"
    path.write_text(text.replace("DefaultValue=0x3E5\n", "DefaultValue=0\n"), encoding="utf-8")
    result = CliRunner().invoke(main, ["canopen", "eds", str(path)])
    assert "modes (0x6502): not stated; those of the drive are read at start\n" in result.output
    assert "TPDO 1, COB-ID 0x181" in result.output
    assert result.exit_code == ExitCode.CONFIGURATION
    assert "the start refuses a drive that is as this file: object 0x6502 is 0; " in result.output
    assert "set check_modes: false" in result.output


@pytest.mark.parametrize(
    ("supported", "modes", "text"),
    [
        ("0x65", [], "stream_mode needs cyclic_position, which object 0x6502"),
        ("0x65", ["--stream-mode", "ip"], ""),
        ("0x1A1", [], "velocity_mode needs profile_velocity, which object 0x6502"),
        ("0x1A1", ["--velocity-mode", "csv"], ""),
    ],
)
def test_the_report_of_a_file_fails_where_the_start_would(
    tmp_path: Path, supported: str, modes: list[str], text: str
) -> None:
    content = Path(eds_path(None, None, GENERIC_DRIVE)).read_text(encoding="utf-8")
    path = tmp_path / "drive.eds"
    path.write_text(content.replace("DefaultValue=0x3E5\n", f"DefaultValue={supported}\n"))
    result = CliRunner().invoke(main, ["canopen", "eds", str(path), *modes])
    assert result.exit_code == (ExitCode.CONFIGURATION if text else 0)
    assert text in result.output
