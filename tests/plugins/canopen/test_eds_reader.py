"""EDS files as the tools of manufacturers write them, and files with an error."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.plugins.canopen.network import drive, options, plan

from robotd.api import DescriptorError
from robotd_canopen.eds_reader import parse_eds
from robotd_canopen.object_dictionary import variable

NODE = 5
SMALL = """\
[FileInfo]
FileName=small.eds
[DeviceInfo]
VendorName=Müller Antriebe
BaudRate_10=
NrOfRXPDO=
[DummyUsage]
Dummy0002=1
Dummy0005=
[Comments]
Lines=2
Line1=a text
without a key
[6040]
ParameterName=Controlword
ObjectType=0x7
DataType=0x0006
AccessType=rww
DefaultValue=0
PDOMapping=1
[1800]
ParameterName=TPDO 1
ObjectType=0x9
SubNumber=3
[1800sub0]
ParameterName=Number of entries
DataType=0x0005
AccessType=ro
DefaultValue=2
[1800sub1]
ParameterName=COB-ID
DataType=0x0007
AccessType=rw
DefaultValue=$NODEID + 0x180
"""


def read(text: str | bytes) -> dict[tuple[int, int], tuple[int, str, bool, int | None]]:
    """Type, access, mapping and default of each entry."""
    data = text if isinstance(text, bytes) else text.encode()
    found = parse_eds(data, Path("small.eds"), NODE)
    keys = [(0x6040, 0), (0x1800, 0), (0x1800, 1)]
    entries = [(key, variable(found, *key)) for key in keys]
    return {
        key: (one.data_type, one.access_type, bool(one.pdo_mappable), one.default)
        for key, one in entries
        if one is not None
    }


EXPECTED = {
    (0x6040, 0): (6, "rww", True, 0),
    (0x1800, 0): (5, "ro", False, 2),
    (0x1800, 1): (7, "rw", False, 0x185),
}


@pytest.mark.parametrize(
    "encoding", ["utf-8", "utf-8-sig", "latin-1", "cp1252", "utf-16", "utf-16-le"]
)
@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
def test_encodings_and_line_ends(encoding: str, line_end: str) -> None:
    text = SMALL.replace("\n", line_end)
    if encoding == "utf-16-le":
        text = f"\ufeff{text}"
    assert read(text.encode(encoding)) == EXPECTED


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("[6040]\n", "# a comment\n  ; another\n\n[6040] ; remark\n"),
        ("DataType=0x0006", "DataType = 0x0006 ; UNSIGNED16"),
        ("DataType=0x0006", "DataType=006"),
        ("DataType=0x0006", "datatype=6"),
        ("ObjectType=0x7", "ObjectType="),
        ("ObjectType=0x7", "OBJECTTYPE=0X7"),
        ("DefaultValue=0\n", "DefaultValue=00000000\n"),
        ("PDOMapping=1", "PDOMapping=0x01"),
        ("AccessType=rww", "AccessType=RWW"),
        ("[1800sub1]", "[1800SUB01]"),
        ("[6040]", "[6040 ]"),
        ("$NODEID + 0x180", "0x180+$NodeID"),
        ("$NODEID + 0x180", "$NODEID+384"),
        ("$NODEID + 0x180", "0x00000185"),
        ("AccessType=rww", "AccessType=rww\nAccessType=rww"),
        ("[Comments]", "[Comments]\nLines=1\n[Comments]"),
        ("DefaultValue=0\n", "DefaultValue=0\nLowLimit=\nHighLimit=many\n"),
    ],
)
def test_habits_of_tools(old: str, new: str) -> None:
    assert old in SMALL
    assert read(SMALL.replace(old, new, 1)) == EXPECTED


@pytest.mark.parametrize("end", ["\x1a", "\x1a\x1a\r\n", "\n\x1a\x03\xff not a line"])
def test_control_z_ends_a_file_of_dos(end: str) -> None:
    assert read(SMALL + end) == EXPECTED


def test_a_leading_zero_is_octal_where_it_can_be() -> None:
    """CiA 306-1: decimal, hexadecimal with 0x, octal with 0."""
    for text, value in (("012", 10), ("0100", 64), ("08", 8), ("0190", 190), ("-010", -8)):
        changed = SMALL.replace("DefaultValue=0\n", f"DefaultValue={text}\n")
        assert read(changed)[0x6040, 0][3] == value


def test_a_default_that_is_no_number_is_none() -> None:
    """It is of use to the simulation alone."""
    assert read(SMALL.replace("DefaultValue=0\n", "DefaultValue=n/a\n"))[0x6040, 0][3] is None


def test_dummies_and_compact_arrays() -> None:
    compact = """\
[2000]
ParameterName=Valve
ObjectType=0x8
DataType=0x0006
AccessType=ro
PDOMapping=1
CompactSubObj=3
[2000Name]
NrOfEntries=1
2=Second
"""
    found = parse_eds((SMALL + compact).encode(), Path("small.eds"), NODE)
    assert [index for index in range(1, 8) if index in found.indices] == [2]
    names = [variable(found, 0x2000, sub).name for sub in range(4)]  # type: ignore[union-attr]
    assert names == ["Number of entries", "Valve 1", "Second", "Valve 3"]
    third = variable(found, 0x2000, 3)
    assert third is not None
    assert (third.data_type, third.access_type, third.pdo_mappable) == (6, "ro", True)
    count = variable(found, 0x2000, 0)
    assert count is not None
    assert count.default == 3


def test_a_type_of_the_manufacturer_is_looked_up() -> None:
    """The object of its number says in its first entry what it is."""
    own = "[00A0]\nObjectType=0x6\n[00A0sub1]\nDataType=0x0007\nDefaultValue=0x0005\n"
    changed = SMALL.replace("DataType=0x0006", "DataType=0x00A0") + own
    assert read(changed)[0x6040, 0][0] == 5


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("DataType=0x0006", "DataType=word", r"small.eds:17: \[6040\] DataType: 'word' is not a"),
        ("DataType=0x0006\n", "", r"small.eds:14: \[6040\] DataType: missing"),
        ("DataType=0x0006", "DataType=", r"small.eds:17: \[6040\] DataType: missing"),
        ("PDOMapping=1", "PDOMapping=0x", r"small.eds:20: \[6040\] PDOMapping: '0x' is not a num"),
        ("[1800]", "[6040]", r"small.eds:21: section \[6040\] was given before, on line 14"),
        (
            "PDOMapping=1",
            "PDOMapping=1\nAccessType=ro",
            r"small.eds:21: \[6040\] AccessType: 'ro', and 'rww' on line 18",
        ),
        ("PDOMapping=1", "PDOMapping", r"small.eds:20: neither a section nor key=value"),
        ("[FileInfo]\n", "", r"small.eds:1: neither a section nor key=value"),
    ],
)
def test_an_error_has_section_key_and_line(old: str, new: str, text: str) -> None:
    with pytest.raises(DescriptorError, match=text) as caught:
        read(SMALL.replace(old, new, 1))
    assert "\n" not in str(caught.value)


def test_a_file_without_objects_is_no_eds() -> None:
    for text in ("", "[FileInfo]\nFileName=x\n", "\x1a"):
        with pytest.raises(DescriptorError, match="has no objects: it is no EDS"):
            read(text)


def test_an_unreadable_file_is_one_problem(tmp_path: Path) -> None:
    """Not also six objects and ten PDO entries that it does not have, for each of its drives."""
    path = tmp_path / "drive.eds"
    path.write_text(SMALL.replace("DataType=0x0006", "DataType=word"), encoding="utf-8")
    module = {"node": 16, "eds": str(path)}
    with pytest.raises(DescriptorError) as caught:
        plan(options(axes=[drive(0, eds=str(path)), drive(1, eds=str(path))], io=[module]))
    (line,) = str(caught.value).splitlines()
    assert "backends.canopen.axes.0.eds: " in line
    assert "drive.eds:17: [6040] DataType: 'word' is not a number" in line
