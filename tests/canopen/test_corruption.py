"""Garbage on the bus: 200 random frames on every kind of COB-ID kill nothing."""

from __future__ import annotations

import random

import can
from tests.canopen.conftest import OpenRig

from robotd.cycle.execution import Outcome

# SDO answers, heartbeats, EMCY, TPDOs, and a few that belong to nobody. Heartbeats and TPDOs of
# correct length are believed (there is no way to tell), so those are sent with a wrong length.
ANSWERS = [0x580 + node for node in range(1, 7)]
CYCLIC = [base + node for base in (0x180, 0x280, 0x380, 0x700) for node in range(1, 7)]
OTHERS = [0x081, 0x6FF, 0x7E4, 0x123]


def test_random_frames(open_rig: OpenRig) -> None:
    rng = random.Random(7)
    with open_rig(sdo_timeout_s=0.1) as rig:
        bus = can.Bus(interface="virtual", channel=rig.master.bus.name)
        try:
            with rig.robot.follower.follow(rig.request(1.2, 0.5)) as execution:
                for _ in range(200):
                    cob_id = rng.choice(ANSWERS + CYCLIC + OTHERS)
                    length = rng.choice((0, 2, 3)) if cob_id in CYCLIC else rng.randint(0, 8)
                    data = rng.randbytes(length)
                    bus.send(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))
                assert execution.wait(6)
            assert execution.outcome is Outcome.SUCCEEDED
            rig.until(lambda: rig.master.bus.counters.malformed > 50)
        finally:
            bus.shutdown()
        assert rig.robot.engine.ready
        for node in rig.master.nodes.values():
            assert node.sdo.read(0x1000) & 0xFFFF in (401, 402)
