"""Faults of other nodes and of frames, which are problems with a name of their own."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import can
import pytest
from tests.plugins.independent.conftest import GROUP, PORT, RATE_HZ, OpenBench

from robotd.control.loop.setpoint_source import Outcome
from robotd.errors import RobotdError

SYNC = can.Message(arbitration_id=0x80, is_extended_id=False)
SECOND_SYNC = r"another node sends SYNC \(COB-ID 0x080\), too"
SHORT = r"TPDO 1 \(shorter than mapped: 5 of 7 bytes\)"


@contextmanager
def second_producer() -> Iterator[None]:
    with can.Bus(interface="udp_multicast", channel=GROUP, port=PORT, hop_limit=0) as bus:
        bus.send_periodic(SYNC, 1 / RATE_HZ)
        yield


def test_a_second_sync_producer_stops_a_motion_and_the_next_start(open_bench: OpenBench) -> None:
    with open_bench() as bench:
        bench.robot.start()
        status = bench.robot.fieldbus.status
        with second_producer():
            execution = bench.move(-1.5, 20.0)
            assert execution.outcome is Outcome.FAULT
            bench.until(lambda: "another node sends SYNC" in status(0).note)
            bench.robot.axes.servo(0, False)
            with pytest.raises(RobotdError, match=SECOND_SYNC):
                bench.robot.axes.servo(0, True)
            assert not bench.drive["energised"]
        bench.until(lambda: "another node sends SYNC" not in status(0).note)
        bench.robot.recover()
        assert bench.move(1.0).outcome is Outcome.SUCCEEDED
        assert not bench.has_jumped()


def test_a_tpdo_that_is_shorter_than_mapped_leaves_the_servo_off(open_bench: OpenBench) -> None:
    with open_bench(missing_bytes=2) as bench:
        with pytest.raises(RobotdError, match=SHORT):
            bench.robot.start()
        assert "enabled" not in bench.drive["counts"]


def test_a_tpdo_that_becomes_short_is_the_reason_of_the_loss(open_bench: OpenBench) -> None:
    with open_bench() as bench:
        bench.robot.start()
        bench.drive.set(missing_bytes=2)
        bench.until(lambda: "shorter than mapped: 5 of 7 bytes" in bench.image.reason[0])
        bench.drive.wait(lambda measured: abs(measured["velocity"]) < 1)
