"""Section of the descriptor: what is rejected before there is a bus."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError
from tests.plugins.ethercat.harness import descriptor

from robotd.descriptor import RobotDescriptor, load_robot_descriptor, validate_section
from robotd.errors import DescriptorError
from robotd_ethercat.options import EthercatOptions
from robotd_ethercat.plan import plan_bus

AXES = [{"axis": number, "slave": number, "counts_per_rad": 1e5} for number in range(2)]


def plan_problem(robot: RobotDescriptor) -> str:
    options = validate_section(robot, "backends.ethercat", EthercatOptions)
    with pytest.raises(DescriptorError) as caught:
        plan_bus(robot, options)
    return str(caught.value)


@pytest.mark.parametrize(
    ("section", "text"),
    [
        ({"axes": [AXES[0], AXES[0]]}, "axis 0 is given twice; slave 0 is given twice with"),
        ({"axes": AXES, "io": [{"slave": 1}]}, "slave 1 is given twice"),
        ({"axes": AXES, "io": [{"slave": 4}, {"slave": 4}]}, "slave 4 is given twice"),
        ({"interface": "eth1", "redundant_interface": "eth1"}, "redundant_interface is 'eth1'"),
        ({"redundant_interface": "eth1"}, "redundant_interface needs clocks: off"),
        ({"axes": [{**AXES[0], "polarity": 2}]}, "polarity 2 is not 1 or -1"),
    ],
)
def test_the_section_itself_is_checked(section: dict[str, Any], text: str) -> None:
    with pytest.raises(ValidationError, match=text):
        EthercatOptions.model_validate(section)


def test_axes_and_drives_must_fit() -> None:
    axes = [{"axis": 0, "slave": 0}, {"axis": 5, "slave": 1}]
    text = plan_problem(descriptor(axes=axes))
    assert "axis 1 of the robot has no drive" in text
    assert "axis 5 does not exist, the robot has axes 0 to 1" in text


def test_the_interface_must_be_named_unless_the_slaves_are_simulated() -> None:
    text = plan_problem(descriptor(interface=None))
    assert "backends.ethercat.interface: missing: name the network interface of the bus" in text
    robot = descriptor(interface=None, simulated=True)
    plan = plan_bus(robot, validate_section(robot, "backends.ethercat", EthercatOptions))
    assert plan.bus_name == "simulated slaves"


def test_a_mode_of_canopen_is_rejected() -> None:
    axes = [{"axis": 0, "slave": 0, "stream_mode": "ip"}, {"axis": 1, "slave": 1}]
    assert "'ip' is a mode of CANopen drives" in plan_problem(descriptor(axes=axes))


def test_a_mapping_without_a_needed_object_is_rejected() -> None:
    pdos = [{"index": 0x1600, "objects": ["0x6040", "0x6060"]}]
    axes = [{"axis": 0, "slave": 0, "rx_pdos": pdos}, {"axis": 1, "slave": 1}]
    text = plan_problem(descriptor(axes=axes))
    assert "axes.0.rx_pdos: no PDO holds 0x607A (target position), 0x60FF" in text


def test_the_second_axis_of_a_drive_needs_its_own_objects() -> None:
    pdos = [{"index": 0x1A10, "objects": ["0x6841", "0x6861", "0x6864"]}]
    axes = [{"axis": 0, "slave": 0}, {"axis": 1, "slave": 0, "axis_offset": 1, "tx_pdos": pdos}]
    robot = descriptor(axes=axes)
    plan = plan_bus(robot, validate_section(robot, "backends.ethercat", EthercatOptions))
    assert [len(options) for options in plan.slaves.values()] == [2, 1]


def test_an_axis_has_the_robots_ramp_of_a_controlled_stop_unless_it_has_its_own() -> None:
    axes = [
        {"axis": 0, "slave": 0, "counts_per_rad": 1e5},
        {"axis": 1, "slave": 1, "counts_per_rad": 1e5, "stop_deceleration_rad_s2": 3.0},
    ]
    robot = load_robot_descriptor("tricycle_base")
    for section, ramps in (
        (axes, [10.0, 3.0]),
        ([axes[0], AXES[1]], [10.0, 6.0]),  # of the wheel, of the steering
    ):
        given = EthercatOptions.model_validate({"interface": "eth7", "axes": section})
        plan = plan_bus(robot, given)
        assert [axis.stop_deceleration_rad_s2 for axis in plan.axes] == ramps
