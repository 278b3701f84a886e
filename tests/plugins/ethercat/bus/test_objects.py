"""SDO and register access beside the cyclic exchange, over real frames."""

from __future__ import annotations

from tests.plugins.ethercat.bus.robot import started

from robotd.control.loop.setpoint_source import Outcome


def test_objects_and_registers_are_read_while_the_arm_moves() -> None:
    with started() as robot:
        fieldbus = robot.robot.fieldbus
        with robot.robot.follower.follow(robot.request(1.5, 0.5, 0.5)) as execution:
            for number in range(40):
                assert fieldbus.read_object(0, 1 + number % 3, 0x6502)
                assert len(fieldbus.read_register(0, number % 4, 0x0130, 2)) == 2
            execution.wait(15.0)
        assert execution.outcome is Outcome.SUCCEEDED, execution.message
        status = fieldbus.status(0)
        assert [node.extra["invalid_frames"] for node in status.nodes] == [0, 0, 0, 0]
