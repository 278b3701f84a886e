"""Garbage on the bus, on every kind of COB-ID, kills nothing."""

from __future__ import annotations

import random
from contextlib import suppress

import can
from tests.plugins.canopen.bus.conftest import SMALL, OpenRig

from robotd.control.loop.setpoint_source import Outcome
from robotd.errors import RobotdError

# SDO answers, heartbeats, EMCY, TPDOs, and a few that belong to nobody. Heartbeats and TPDOs of
# correct length are believed (there is no way to tell), so those are sent with a wrong length.
ANSWERS = [0x580 + node for node in range(1, 7)]
CYCLIC = [base + node for base in (0x180, 0x280, 0x380, 0x700) for node in range(1, 7)]
OTHERS = [0x081, 0x6FF, 0x7E4, 0x123]
FRAMES = 200
FAR_RAD = 0.5  # where no command of the test leads


def test_strange_frames_do_not_disturb_a_trajectory(open_rig: OpenRig) -> None:
    rng = random.Random(7)
    with open_rig(sdo_timeout_s=0.1) as harness:
        bus = can.Bus(interface="virtual", channel=harness.master.bus.name)
        try:
            with harness.robot.follower.follow(harness.request(1.2, 0.5)) as execution:
                for _ in range(FRAMES):
                    cob_id = rng.choice(ANSWERS + CYCLIC + OTHERS)
                    length = rng.choice((0, 2, 3)) if cob_id in CYCLIC else rng.randint(0, 8)
                    data = rng.randbytes(length)
                    bus.send(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))
                assert execution.wait(6)
            assert execution.outcome is Outcome.SUCCEEDED
            harness.until(lambda: harness.master.bus.counters.malformed > 50)
        finally:
            bus.shutdown()
        assert harness.robot.connection.ready
        for node in harness.master.nodes.values():
            assert node.sdo.read(0x1000) & 0xFFFF in (401, 402)


def test_corrupted_answers_and_pdos_kill_nothing(open_rig: OpenRig) -> None:
    """Every third frame of a node is garbage, during bring-up and motion."""
    with open_rig(SMALL, sdo_timeout_s=0.08) as harness:
        engine = harness.robot.connection
        harness.inject("2 garble 0.3")
        while harness.drive(2).faults.garbled_frames < FRAMES:
            engine.stop_communication()
            with suppress(RobotdError):
                engine.start_communication()
            with suppress(RobotdError):
                harness.robot.servos.enable()
            with suppress(RobotdError):
                harness.follow(0.2, 0.1)
            assert abs(harness.drive(2).drives[0].position) < FAR_RAD
        harness.inject("2 heal")
        engine.stop_communication()
        engine.start_communication()
        harness.robot.servos.enable()
        assert harness.follow(0.8, 0.2).outcome is Outcome.SUCCEEDED
        assert all(thread.is_alive() for thread in harness.threads())
