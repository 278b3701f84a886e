"""ESI files: devices, names, modules in slots, and the PDOs that robotd chooses."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from tests.fakes import FakeClock
from tests.plugins.ethercat.fake_bus import FakeBus

import robotd_ethercat.bus_scan  # before it is patched: it takes Soem from the other module
import robotd_ethercat.soem
from robotd.cli import main
from robotd.cli.exit_codes import ExitCode
from robotd.errors import DescriptorError
from robotd_ethercat.esi_choice import pdo_keys
from robotd_ethercat.esi_device import EsiDevice
from robotd_ethercat.esi_reader import MAX_SLOTS, EsiLibrary, read_esi

ESI = Path(__file__).parent / "esi"
DRIVE, MODULAR = ESI / "drive.xml", ESI / "modular.xml"
WANTED = {(0x1234, 0x5678)}


def changed(folder: Path, source: Path = DRIVE, **changes: str) -> Path:
    text = source.read_text(encoding="utf-8")
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    path = folder / "changed.xml"
    path.write_text(text, encoding="utf-8")
    return path


def drive(path: Path = DRIVE) -> EsiDevice:
    return read_esi(path, WANTED)[-1]


def test_the_devices_of_a_file() -> None:
    found = read_esi(DRIVE)
    assert [device.name for device in found] == ["Old revision", "Servo drive DRV-1", "Digital I/O"]
    one = found[1]
    assert one.vendor_name == "Müller Antriebe"
    assert (one.vendor, one.product, one.revision) == (0x1234, 0x5678, 0x20000)
    assert one.profiles == (402,)
    assert [(mode.name, mode.activate, mode.shift_ns) for mode in one.clocks] == [
        ("DC", 0x300, 125_000),
        ("SM", 0, 0),
    ]
    assert [(pdo.index, pdo.is_assigned, pdo.is_fixed) for pdo in one.pdos] == [
        (0x1600, True, True),
        (0x1601, False, True),
        (0x1A00, True, False),
    ]
    assert found[2].product == 4660


@pytest.mark.parametrize(
    ("number", "name"),
    [
        ((0x608F, 1), "Encoder resolution: Encoder increments"),
        ((0x603F, 0), "Error code"),
        ((0x6060, 0), "Modes of operation"),
        ((0x2000, 0), ""),
    ],
)
def test_names_of_objects_come_from_the_dictionary_and_the_pdos(
    number: tuple[int, int], name: str
) -> None:
    assert drive().object_name(*number) == name


def test_modules_are_moved_to_their_slots() -> None:
    [twin] = read_esi(MODULAR)
    assert [pdo.index for pdo in twin.pdos] == [0x1600, 0x1A00, 0x1610, 0x1A10]
    assert [entry.index for entry in twin.pdos[2].entries] == [0x6840, 0x6860, 0x687A]
    assert twin.object_name(0x6840, 0) == "Controlword"
    assert [(slot.name, slot.module) for slot in twin.slots] == [
        ("Axis 0", 0x119800),
        ("Axis 1", 0x119800),
        ("Option", None),
    ]


def test_profiles_of_channels(tmp_path: Path) -> None:
    channel = "<ChannelInfo><ProfileNo>402</ProfileNo><AddInfo>2</AddInfo></ChannelInfo>"
    path = changed(tmp_path, MODULAR, **{"<ProfileNo>402</ProfileNo>": channel})
    assert read_esi(path)[0].profiles == (5001, 402)


def test_the_steps_of_a_slot_precede_those_of_all_slots(tmp_path: Path) -> None:
    own = 'MinInstances="1" SlotPdoIncrement="#x20" SlotIndexIncrement="256"'
    [twin] = read_esi(changed(tmp_path, MODULAR, **{'MinInstances="1"': own}))
    assert [pdo.index for pdo in twin.pdos] == [0x1600, 0x1A00, 0x1620, 0x1A20]
    assert [entry.index for entry in twin.pdos[2].entries] == [0x6140, 0x6160, 0x617A]


@pytest.mark.parametrize("folder", ["Twin Modules", "."])
def test_modules_of_another_file(tmp_path: Path, folder: str) -> None:
    """The ESI refers to it in the manner of Windows; it may be copied beside it."""
    text = MODULAR.read_text(encoding="utf-8")
    device, _, modules = text.partition("<Modules>")
    reference = r"<EtherCATInfo><InfoReference>Twin Modules\Axes.xml</InfoReference>"
    esi = tmp_path / "twin.xml"
    device = device.replace("<EtherCATInfo>", reference)
    esi.write_text(f"{device}</Descriptions></EtherCATInfo>", encoding="utf-8")
    lines = run("esi", esi)
    assert (
        "slot 0 (Axis 0): module 0x119800, which is not in the ESI: its PDOs are unknown" in lines
    )

    other = tmp_path / folder / "Axes.xml"
    other.parent.mkdir(exist_ok=True)
    modules = modules.replace("</Descriptions></EtherCATInfo>", "").partition("</Modules>")[0]
    other.write_text(
        f"<EtherCATModule><Vendor><Id>7</Id></Vendor><Modules>{modules}</Modules></EtherCATModule>",
        encoding="utf-8",
    )
    [twin] = read_esi(esi)
    [whole] = read_esi(MODULAR)
    assert (twin.path, twin.vendor) == (esi, whole.vendor)
    assert (twin.pdos, twin.names, twin.modules) == (whole.pdos, whole.names, whole.modules)

    other.write_text("<EtherCATModule><Modules>", encoding="utf-8")
    with pytest.raises(DescriptorError, match=r"Axes\.xml:1: not valid XML"):
        read_esi(esi)


def test_a_reference_out_of_the_folder_is_not_followed(tmp_path: Path) -> None:
    reference = r"<EtherCATInfo><InfoReference>..\secret.xml</InfoReference>"
    (tmp_path / "secret.xml").write_text("no XML", encoding="utf-8")
    (tmp_path / "esi").mkdir()
    path = changed(tmp_path / "esi", MODULAR, **{"<EtherCATInfo>": reference})
    assert len(read_esi(path)) == 1


def test_pdos_of_a_drive_whose_default_lacks_objects() -> None:
    assert pdo_keys(drive(), pv=False) == {
        0: {
            "rx_pdos": [{"index": "0x1601"}],
            "tx_pdos": [
                {"index": "0x1A00", "objects": ["0x6041", "0x6061", "0x6064", "0x606C", "0x603F"]}
            ],
        }
    }


def test_a_default_that_has_all_objects_is_left_alone(tmp_path: Path) -> None:
    display = "<Entry><Index>#x6061</Index><SubIndex>0</SubIndex><BitLen>8</BitLen></Entry>"
    path = changed(
        tmp_path,
        **{'<RxPdo Fixed="1">': '<RxPdo Fixed="1" Sm="2">', "</TxPdo>": f"{display}</TxPdo>"},
    )
    assert pdo_keys(drive(path), pv=False) == {0: {}}


def test_pdos_that_exclude_each_other_are_not_combined(tmp_path: Path) -> None:
    """0x60FF is only in the PDO that excludes the one with the other objects."""
    second = "<Name>All modes</Name>"
    text = DRIVE.read_text(encoding="utf-8")
    begin = text.index("<Entry><Index>#x60FF", text.index(second))
    entry = text[begin : text.index("</Entry>", begin) + len("</Entry>")]
    path = tmp_path / "exclusive.xml"
    text = text[:begin] + text[begin + len(entry) :]
    path.write_text(text.replace('PdoConfig="1"', 'PdoConfig="0"'), encoding="utf-8")
    [keys] = pdo_keys(drive(path), pv=False).values()
    assert keys == {
        "remark": "no PDO in the ESI holds 0x60FF (target velocity);"
        " no PDO in the ESI holds 0x6061 (modes of operation display)"
    }


def test_a_constant_assignment_is_not_changed(tmp_path: Path) -> None:
    keys = {'PdoAssign="1"': 'PdoAssign="false"', 'PdoConfig="1"': 'PdoConfig="false"'}
    [chosen] = pdo_keys(drive(changed(tmp_path, **keys)), pv=False).values()
    assert chosen["remark"].startswith("no PDO of the constant assignment in the ESI holds 0x6060")
    assert "rx_pdos" not in chosen


def test_a_drive_without_a_target_velocity_takes_pv() -> None:
    [twin] = read_esi(MODULAR)
    keys = pdo_keys(twin, pv=False)
    assert [sorted(one) for one in keys.values()] == [["remark", "velocity_mode"]] * 2


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("#X20000", "two", r"changed.xml:\d+: Type/@RevisionNo: 'two' is not a number"),
        ("<BitLen>8</BitLen>", "<BitLen>0x</BitLen>", "BitLen: '0x' is not a number"),
        ("EtherCATInfo", "Robot", "is no ESI: the root is 'Robot'"),
        ("</Devices>", "", "not valid XML"),
        ("<EtherCATInfo", "<!DOCTYPE x><EtherCATInfo", "a DOCTYPE is not allowed"),
    ],
)
def test_files_that_are_rejected(tmp_path: Path, old: str, new: str, what: str) -> None:
    with pytest.raises(DescriptorError, match=what):
        read_esi(changed(tmp_path, **{old: new}))


def test_a_doctype_in_utf_16_is_rejected(tmp_path: Path) -> None:
    path = tmp_path / "wide.xml"
    text = "<!DOCTYPE x [<!ENTITY e SYSTEM 'file:///etc/passwd'>]><EtherCATInfo>&e;</EtherCATInfo>"
    path.write_bytes(text.encode("utf-16"))
    with pytest.raises(DescriptorError, match="a DOCTYPE is not allowed"):
        read_esi(path)


def test_limits_of_slots_and_objects(tmp_path: Path) -> None:
    many = f'MaxInstances="{MAX_SLOTS + 1}"'
    with pytest.raises(DescriptorError, match=f"more than {MAX_SLOTS} slots"):
        read_esi(changed(tmp_path, MODULAR, **{'MaxInstances="1"': many}))
    entries = "<Entry/>" * 2000
    path = changed(
        tmp_path,
        MODULAR,
        **{
            "</RxPdo>": f"{entries}</RxPdo>",
            'MinInstances="1" MaxInstances="1"': 'MinInstances="60" MaxInstances="60"',
        },
    )
    with pytest.raises(DescriptorError, match="more than 100_000 objects in the modules"):
        read_esi(path)


def test_a_folder_is_looked_through_for_the_devices_on_the_bus(tmp_path: Path) -> None:
    shutil.copy(DRIVE, tmp_path / "DRIVE.XML")
    shutil.copy(MODULAR, tmp_path)
    (tmp_path / "broken.xml").write_text("<x>5678", encoding="utf-8")
    (tmp_path / "other.xml").write_text("<not an ESI", encoding="utf-8")  # names no product
    library = EsiLibrary(tmp_path, WANTED)
    assert len(library.problems) == 1
    assert "broken.xml:1: not valid XML" in library.problems[0]
    names = [library.find(0x1234, 0x5678, revision) for revision in (1, 0x1FFFF, 0x30000)]
    assert [one.name if one else None for one in names] == [
        "Old revision",
        "Old revision",
        "Servo drive DRV-1",
    ]
    assert library.find(0x5678, 0x99, 1) is None, "not on the bus"


def run(*arguments: str | Path) -> str:
    outcome = CliRunner().invoke(main, ["ethercat", *map(str, arguments)])
    assert outcome.exit_code == 0, outcome.output
    return outcome.output


def test_the_command_shows_devices_and_details() -> None:
    text = run("esi", DRIVE)
    assert text.splitlines()[2].startswith("Digital I/O (Müller Antriebe), vendor 0x00001234")
    text = run("esi", DRIVE, "--product", "0x5678")
    assert "RxPDO 0x1601 All modes (not assigned, fixed, not with 0x1600)" in text
    assert "clock DC: AssignActivate 0x0300, SYNC0 shifted by 125000 ns" in text
    outcome = CliRunner().invoke(main, ["ethercat", "esi", str(DRIVE), "--product", "7"])
    assert outcome.exit_code == ExitCode.CONFIGURATION
    assert "has no product 0x00000007 (available: 0x00001234, 0x00005678)" in outcome.output


def test_a_robot_is_made_from_esi_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two modules and a drive; the descriptor that is written passes the check."""
    monkeypatch.chdir(tmp_path)
    scan = run("esi", DRIVE, "--product", "0x5678", "--product", "4660", "--json")
    (tmp_path / "bus.json").write_text(scan, encoding="utf-8")
    outcome = CliRunner().invoke(main, ["new-robot", "axes", "--bus", "bus.json"])
    assert outcome.exit_code == 0, outcome.output
    path = tmp_path / "axes" / "robot.yaml"
    text = path.read_text(encoding="utf-8").replace(
        "axis: 0, slave", "axis: 0, counts_per_rad: 9, slave"
    )
    path.write_text(text, encoding="utf-8")
    checked = ["check", "--robot", str(path), "--backend", "ethercat"]
    outcome = CliRunner().invoke(main, [*checked, "--set", "backends.ethercat.interface=eth7"])
    assert "ok    options of ethercat" in outcome.output


@pytest.fixture
def bus(monkeypatch: pytest.MonkeyPatch) -> FakeBus:
    made = FakeBus(FakeClock(), drives=2)
    made.slaves = []
    monkeypatch.setattr(robotd_ethercat.soem, "Soem", lambda *_: made)
    monkeypatch.setattr("robotd_ethercat.bus_scan.Soem", lambda *_: made)
    return made


def test_a_scan_with_esi_files(bus: FakeBus) -> None:
    bus.all[2].identity = (0x1234, 0x9999, 1, 1)
    lines = run("scan", "--interface", "eth7", "--esi", ESI).splitlines()
    assert lines[1].strip().startswith("ESI drive.xml: Old revision")
    assert "           no ESI" in lines
    found: dict[str, Any] = json.loads(run("scan", "--interface", "eth7", "--esi", ESI, "--json"))
    assert len(found["axes"]) == 2


def test_a_mapping_with_the_names_of_the_esi(bus: FakeBus) -> None:
    assert "0x6040:00 16 bit\n" in run("pdo", "--interface", "eth7", "1")
    bus.all[1].identity = (0x1234, 0x5678, 0x20000, 1)
    text = run("pdo", "--interface", "eth7", "--esi", ESI, "1")
    assert "    0x6040:00 16 bit Controlword\n" in text
