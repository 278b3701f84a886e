"""One drive with two axes on one node, the second with objects 0x800 further."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from tests.plugins.canopen.bus.conftest import SMALL, OpenRig
from tests.plugins.canopen.bus.drives_process import SOON_STALE
from tests.plugins.canopen.bus.harness import broken
from tests.plugins.canopen.bus.two_axis_eds import write_two_axis_eds

from robotd.control.loop.setpoint_source import Outcome
from robotd.device.axes import Jog, Move
from robotd.device.state import CommandMode
from robotd.motion.profile import Profile

RPDOS = [["0x6040", "0x6060", "0x607A"], ["0x60FF"]]
TPDOS = [["0x6041", "0x6061", "0x6064"], ["0x606C", "0x6077", "0x603F"], ["0x6062", "0x60FD"]]


def pdos(first: int, maps: list[list[str]]) -> list[dict[str, Any]]:
    """PDO 65 and on, with COB-IDs that nobody else has."""
    return [
        {"number": 65 + place, "cob_id": first + 0x100 * place, "objects": objects}
        for place, objects in enumerate(maps)
    ]


@pytest.fixture
def drive(tmp_path: Path) -> dict[str, Any]:
    """Options of a robot: axes 0 and 1 in one drive, axis 2 in another."""
    common = {"counts_per_rad": 1e5, "startup": [{"object": "0x6065", "value": 12345}]}
    double = common | {"node": 1, "eds": str(write_two_axis_eds(tmp_path / "two_axis.eds"))}
    second = double | {"axis_offset": 1, "rpdos": pdos(0x20A, RPDOS), "tpdos": pdos(0x18A, TPDOS)}
    return {
        "axis_defaults": {},
        "axes": [
            double | {"axis": 0},
            second | {"axis": 1, "polarity": -1},
            common | {"axis": 2, "node": 3},
        ],
    }


def test_each_axis_obeys_its_own_objects(open_rig: OpenRig, drive: dict[str, Any]) -> None:
    with open_rig(SMALL, **drive) as harness:
        assert sorted(harness.network.members) == [1, 3, 16]
        assert harness.follow(0.6, 0.3).outcome is Outcome.SUCCEEDED
        harness.robot.axes.move([Move(1, -0.2, Profile(1.0, 5.0, 5.0))])
        harness.idle(1)
        assert harness.positions()[:2] == pytest.approx([0.3, -0.2], abs=2e-3)
        values = harness.drive(1).values
        assert values[0x6064, 0] == pytest.approx(0.3e5, abs=200)
        assert values[0x6864, 0] == pytest.approx(0.2e5, abs=200)
        assert values[0x6065, 0] == values[0x6865, 0] == 12345


def test_modes_and_alarms_are_separate(open_rig: OpenRig, drive: dict[str, Any]) -> None:
    with open_rig(SMALL, **drive) as harness:
        axes = harness.robot.axes
        axes.set_command_mode(1, CommandMode.VELOCITY)
        axes.jog([Jog(1, Profile(0.5, 2.0, 2.0))])
        harness.until(lambda: abs(harness.image.velocity[1] - 0.5) < 1e-2)
        assert abs(harness.image.velocity[0]) < 1e-2
        harness.network.call(lambda: harness.drive(1).drives[1].trip(0x7121))
        # The emergency message is a frame of its own, after the statusword.
        harness.until(lambda: harness.image.reason[1] == "node 1: EMCY 0x7121 motor blocked")
        assert list(harness.image.amp_alarm) == [False, True, False]
        assert harness.image.servo_on[0]
        axes.clear_alarm(1)
        harness.until(lambda: not harness.image.amp_alarm.any())


def test_a_lost_node_loses_both_axes(open_rig: OpenRig, drive: dict[str, Any]) -> None:
    with open_rig(SMALL, engine=SOON_STALE, **drive) as harness:
        stop = broken(harness, "1 silence", healthy=())
        assert stop.execution.outcome is Outcome.FAULT
        assert list(harness.image.offline) == [True, True, False]
        slave = harness.device_state().nodes[0]
        assert (slave.id, slave.axes, slave.offline) == (1, 2, True)
