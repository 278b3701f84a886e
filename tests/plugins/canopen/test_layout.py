from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError
from tests.plugins.canopen.network import drive, options, plan

from robotd.descriptor import load_robot_descriptor
from robotd.errors import DescriptorError
from robotd_canopen.layout import plan_network
from robotd_canopen.object_dictionary import GENERIC_DRIVE, eds_path


def test_the_default_fits_and_has_predefined_cob_ids() -> None:
    layout = plan(options())
    assert [pdo.cob_id for pdo in layout.axes[1].tpdos] == [0x182, 0x282, 0x382]
    assert [pdo.layout.size for pdo in layout.axes[0].rpdos] == [7, 4]
    assert layout.cycles_per_sync == 1


def test_sync_may_be_slower_than_the_cycle_by_a_whole_number() -> None:
    assert plan(options(sync_period_s=0.012)).cycles_per_sync == 3
    with pytest.raises(DescriptorError, match="not a whole number of cycles"):
        plan(options(sync_period_s=0.005))


@pytest.mark.parametrize(
    ("section", "what"),
    [
        ({"axes": [drive(0), drive(1, node=1)]}, "node 1 is given twice"),
        ({"axes": [drive(0), drive(0, node=5)]}, "axis 0 is given twice"),
        ({"io": [{"node": 2}]}, "node 2 is given twice"),
        ({"master_node": 1}, "node 1 is the master's own"),
    ],
)
def test_each_node_once(section: dict[str, Any], what: str) -> None:
    with pytest.raises(ValidationError, match=what):
        options(**section)


@pytest.mark.parametrize("cob_id", [0x080, 0x081, 0x180, 0x581, 0x601, 0x6E0, 0x701])
def test_a_pdo_takes_no_cob_id_of_another_service(cob_id: int) -> None:
    """Process data would arrive as SDO requests, or the answers of a node would be lost."""
    pdo = {"number": 1, "cob_id": cob_id, "objects": ["0x6041", "0x6061", "0x6064"]}
    with pytest.raises(ValidationError, match=f"0x{cob_id:03X} is not for PDOs: 0x181 to 0x57F"):
        options(axes=[drive(0, tpdos=[pdo]), drive(1)])


@pytest.mark.parametrize(
    ("section", "what"),
    [
        ({"heartbeat_s": 0.5}, "heartbeat_timeout_s: 0.5 s is not above heartbeat_s .* 0.5 s"),
        ({"heartbeat_s": 0.2, "sync_period_s": 0.4}, "sync_period_s together, 0.6 s"),
        ({"heartbeat_timeout_s": 70.0}, "less than or equal to 65.535"),
    ],
)
def test_a_heartbeat_comes_within_its_time_out(section: dict[str, Any], what: str) -> None:
    """Robotd sends its own with SYNC. Object 0x1016 has 16 bits for the time."""
    with pytest.raises(ValidationError, match=what):
        options(**section)


def test_a_pdo_of_more_than_eight_bytes() -> None:
    pdo = {"number": 1, "objects": ["0x6041", "0x6061", "0x6064", "0x606C"]}
    with pytest.raises(DescriptorError, match="11 bytes do not fit in the 8"):
        plan(options(axes=[drive(0, tpdos=[pdo]), drive(1)]))


def test_objects_that_the_eds_does_not_have(tmp_path: Path) -> None:
    eds = tmp_path / "small.eds"
    eds.write_text(
        "[DeviceInfo]\n[6041]\nParameterName=Statusword\nObjectType=7\nDataType=6\n"
        "AccessType=ro\nPDOMapping=1\n",
        encoding="utf-8",
    )
    with pytest.raises(DescriptorError) as caught:
        plan(options(axes=[drive(0, eds=str(eds)), drive(1)]))
    text = str(caught.value)
    assert "backends.canopen.axes.0: object 0x6040 is not in the EDS" in text
    assert "axes.0: default RPDO 1: object 0x6040:00 is not in the EDS" in text


def test_a_mapping_without_what_the_backend_lives_by() -> None:
    pdo = {"number": 1, "objects": ["0x6041", "0x6061"]}
    with pytest.raises(DescriptorError, match="no PDO holds 0x6064"):
        plan(options(axes=[drive(0, tpdos=[pdo]), drive(1)]))


def test_event_driven_tpdos_alone_have_no_age() -> None:
    pdos = [
        {"number": 1, "transmission": 254, "objects": ["0x6041", "0x6061"]},
        {"number": 2, "transmission": 255, "objects": ["0x6064"]},
    ]
    with pytest.raises(DescriptorError, match=r"axes\.0\.tpdos: all TPDOs are event-driven"):
        plan(options(axes=[drive(0, tpdos=pdos), drive(1)]))


def test_an_event_driven_position_that_cannot_be_read(tmp_path: Path) -> None:
    text = Path(eds_path(None, None, GENERIC_DRIVE)).read_text(encoding="utf-8")
    section = text[text.index("[6064]") :].split("[", 2)[1]
    eds = tmp_path / "unreadable.eds"
    eds.write_text(text.replace(section, section.replace("AccessType=ro", "AccessType=wo")))
    pdos = [
        {"number": 1, "transmission": 1, "objects": ["0x6041", "0x6061"]},
        {"number": 2, "transmission": 255, "objects": ["0x6064"]},
    ]
    with pytest.raises(DescriptorError, match=r"TPDO 2 is event-driven, and 0x6064:00 .*by SDO"):
        plan(options(axes=[drive(0, eds=str(eds), tpdos=pdos), drive(1)]))


@pytest.mark.parametrize("transmission", [0, 241, 252, 253])
def test_transmission_types_that_no_frame_answers(transmission: int) -> None:
    pdo = {"number": 1, "transmission": transmission, "objects": ["0x6041", "0x6061", "0x6064"]}
    with pytest.raises(ValidationError, match="transmission"):
        options(axes=[drive(0, tpdos=[pdo]), drive(1)])


def test_a_sync_that_the_bitrate_cannot_carry() -> None:
    slow = options(bus={"bitrate": 125_000}, sync_period_s=0.004)
    with pytest.raises(DescriptorError, match=r"125000 bit/s with 2\d\d%"):
        plan(slow)


def test_an_axis_without_a_drive_and_a_drive_without_an_axis() -> None:
    with pytest.raises(DescriptorError) as caught:
        plan(options(axes=[drive(0), drive(7)]))
    assert "axis 1 of the robot has no drive" in str(caught.value)
    assert "axis 7 does not exist" in str(caught.value)


def test_two_pdos_with_one_cob_id() -> None:
    mine = {"number": 1, "cob_id": 0x182, "objects": ["0x6041", "0x6061", "0x6064"]}
    with pytest.raises(DescriptorError, match="one COB-ID, 0x182"):
        plan(options(axes=[drive(0, tpdos=[mine]), drive(1)]))


def test_common_keys_of_axes() -> None:
    section = options(axis_defaults={"polarity": -1}, axes=[drive(0), drive(1, polarity=1)])
    assert [axis.polarity for axis in section.axes] == [-1, 1]


def test_an_axis_has_the_robots_ramp_of_a_controlled_stop_unless_it_has_its_own() -> None:
    robot = load_robot_descriptor("tricycle_base")
    for own, ramp in (({}, 6.0), ({"stop_deceleration_rad_s2": 3.0}, 3.0)):
        layout = plan_network(robot, options(axes=[drive(0), drive(1, **own)]))
        ramps = [axis.options.stop_deceleration_rad_s2 for axis in layout.axes]
        assert ramps == [10.0, ramp]  # of the wheel, of the steering
