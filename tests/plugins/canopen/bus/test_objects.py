"""Objects of a drive, read and written while the robot runs."""

from __future__ import annotations

import pytest
from structlog.testing import capture_logs
from tests.plugins.canopen.bus.conftest import SMALL, OpenRig

from robotd.device.axes import Jog, Move
from robotd.device.state import CommandMode
from robotd.errors import InvalidArgument, NotReady, OperationError
from robotd.motion.profile import Profile

ACCELERATION = (2, 0x6083, 0)  # of the elbow
TYPE = (0x92, 1, 2, 0)  # CiA 402, servo drive


def test_objects_are_read_in_motion_and_written_at_rest(open_rig: OpenRig) -> None:
    with open_rig(SMALL) as harness:
        robot, fieldbus = harness.robot, harness.robot.fieldbus
        assert tuple(fieldbus.read_object(0, 1, 0x1000)) == TYPE
        robot.axes.move([Move(1, 0.3, Profile(0.2, 2.0, 2.0))])
        ramp = fieldbus.read_object(0, *ACCELERATION)
        moving = r"elbow: writing an object needs an idle axis, this one is in position"
        with pytest.raises(NotReady, match=moving):
            fieldbus.write_object(0, *ACCELERATION, bytes(4))
        assert fieldbus.read_object(0, *ACCELERATION) == ramp
        harness.idle(1)
        fieldbus.write_object(0, *ACCELERATION, b"\x01\x02\0\0")
        assert fieldbus.read_object(0, *ACCELERATION) == b"\x01\x02\0\0"
        assert fieldbus.read_object(0, 1, 0x6083) != b"\x01\x02\0\0", "another node"
        robot.axes.move([Move(1, 0.0, Profile(0.2, 2.0, 2.0))])
        assert fieldbus.read_object(0, *ACCELERATION) == ramp, "the driver writes its ramp again"
        harness.idle(1)


def test_a_rejection_names_node_object_and_reason(open_rig: OpenRig) -> None:
    with open_rig(SMALL) as harness:
        fieldbus = harness.robot.fieldbus
        unknown = r"\(node 1\): reading 0x5FFF:00.* abort 0x06020000"
        with pytest.raises(OperationError, match=unknown):
            fieldbus.read_object(0, 1, 0x5FFF)
        with pytest.raises(InvalidArgument, match=r"node 9 is not on bus 0 \(nodes: \[1, 2"):
            fieldbus.read_object(0, 9, 0x1000)


def test_a_mapped_object_that_robotd_does_not_set_keeps_its_value(open_rig: OpenRig) -> None:
    """With a torque limit of 0 an arm would fall."""
    objects = ["0x6040", "0x6060", "0x607A"], ["0x60FF", "0x6072"]
    rpdos = [{"number": number, "objects": entries} for number, entries in enumerate(objects, 1)]
    with open_rig(SMALL, axis_defaults={"rpdos": rpdos, "counts_per_rad": 1e5}) as harness:
        harness.robot.axes.set_command_mode(1, CommandMode.VELOCITY)
        harness.robot.axes.jog([Jog(1, Profile(0.3, 5.0, 5.0))])
        harness.until(lambda: harness.image.velocity[1] > 0.29)
        assert harness.drive(2).values[0x6072, 0] == 3000


def test_a_drive_that_clips_below_the_limit_of_the_joint_is_named_at_start(
    open_rig: OpenRig,
) -> None:
    startup = [{"object": "0x607F", "value": 100_000}]
    with (
        capture_logs() as lines,
        open_rig(SMALL, axis_defaults={"counts_per_rad": 1e5, "startup": startup}) as harness,
    ):
        limit = harness.robot.descriptor.joints[1].velocity
        assert harness.robot.connection.ready
    [line] = [line for line in lines if "clips" in line["event"] and line["axis"] == 1]
    assert line["node"] == "elbow (node 2)"
    assert line["object"] == "0x607F (max profile velocity) is 100000"
    assert (line["clips_at"], line["joint_limit"]) == ("1 rad/s (or m/s)", f"{limit:.4g}")
