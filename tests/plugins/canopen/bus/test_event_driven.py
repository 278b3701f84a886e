"""Positions in event-driven TPDOs: no drive is energised before its position is known."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from tests.plugins.canopen.bus.conftest import SMALL, OpenRig
from tests.plugins.canopen.bus.harness import Harness

from robotd.errors import ConnectError, NotReady
from robotd_canopen.simulated.simulated_node import OPERATIONAL
from robotd_canopen.simulated_robot import inject
from robotd_cia402.object_numbers import POSITION

START_RAD, PUSHED_RAD = 1.5, 0.7
SMALLEST_RAD = 1e-3
EVENT_DRIVEN = {
    "counts_per_rad": 1e5,
    "simulated_position_rad": START_RAD,
    "tpdos": [
        {"number": 1, "transmission": 1, "objects": ["0x6041", "0x6061", "0x603F"]},
        {"number": 2, "transmission": 255, "objects": ["0x6064", "0x606C"]},
        {"number": 3, "transmission": 4, "objects": ["0x6062"]},
    ],
}


def shafts(harness: Harness) -> list[float]:
    return [harness.drive(node).drives[0].position for node in (1, 2, 3)]


def is_still_at(harness: Harness, position: float) -> bool:
    """Return True if motor and joint 2 are at ``position`` after the servo has been on."""
    harness.master.settle()
    shown, real = harness.positions()[1], shafts(harness)[1]
    return bool(np.abs(np.array([shown, real]) - position).max() < SMALLEST_RAD)


@pytest.mark.parametrize("transmission", [254, 255])
def test_a_drive_does_not_jump_when_it_is_switched_on(open_rig: OpenRig, transmission: int) -> None:
    first, second, third = EVENT_DRIVEN["tpdos"]  # type: ignore[misc]
    changed = EVENT_DRIVEN | {"tpdos": [first, {**second, "transmission": transmission}, third]}
    with open_rig(SMALL, axis_defaults=changed, enable=False) as harness:
        harness.until(lambda: not harness.image.offline.any())
        assert harness.positions() == pytest.approx(START_RAD, abs=SMALLEST_RAD)
        harness.robot.servos.enable()
        assert is_still_at(harness, START_RAD)
        harness.follow(0.5, START_RAD - 0.2)
        assert is_still_at(harness, START_RAD - 0.2)


@pytest.mark.parametrize("loss", ["silence", "reboot", "stop"])
def test_a_drive_that_was_turned_while_it_was_lost(open_rig: OpenRig, loss: str) -> None:
    with open_rig(SMALL, axis_defaults=EVENT_DRIVEN) as harness:
        harness.inject(f"2 {loss}")
        harness.until(lambda: bool(harness.image.offline[1]))
        harness.network.call(partial(harness.drive(2).drives[0].connection_lost))
        harness.until(lambda: not harness.drive(2).drives[0].get(0x6041) & 4)  # without power
        harness.inject(f"2 push {PUSHED_RAD}")
        if loss == "silence":
            harness.inject("2 heal")
            harness.until(lambda: "event-driven" in harness.robot.connection.fault)
        with pytest.raises(NotReady):
            harness.robot.axes.servo(1, True)
        harness.robot.recover()
        assert is_still_at(harness, START_RAD + PUSHED_RAD)


def test_a_position_that_cannot_be_read_is_waited_for(open_rig: OpenRig) -> None:
    with open_rig(SMALL, axis_defaults=EVENT_DRIVEN, enable=False) as harness:
        harness.robot.connection.stop_communication()
        harness.inject(f"2 abort {POSITION:#x} 0x08000000")
        with pytest.raises(ConnectError, match=r"first values: TPDO 2 .*has not come.*0x6064:00"):
            harness.robot.connection.start_communication()


def test_an_axis_whose_position_has_not_come_is_not_switched_on(open_rig: OpenRig) -> None:
    with open_rig(
        SMALL, axis_defaults=EVENT_DRIVEN, enable=False, engine={"servo_timeout_s": 3.0}
    ) as harness:
        harness.until(lambda: not harness.image.offline.any())
        harness.master.feedback.forget(1)
        harness.until(lambda: bool(harness.image.offline[1]))
        with pytest.raises(NotReady, match="position is not known: TPDO 1, TPDO 2, TPDO 3 not"):
            harness.robot.axes.servo(1, True)
        assert "TPDO 2" in harness.image.reason[1]


def test_tpdos_of_drives_that_start_by_themselves(open_rig: OpenRig) -> None:
    """Until a drive is configured its frames have another layout: they are no fault."""
    with open_rig(SMALL, enable=False) as harness:
        harness.robot.connection.close()
        harness.power_on()
        for node in (1, 2, 3):
            assert inject(harness.network, f"{node} emcy 0") == "ok"
            harness.network.call(partial(harness.drive(node).on_nmt, bytes([1, node]), 0))
            assert harness.drive(node).state == OPERATIONAL
        harness.master.open()
        for cob_id in (0x182, 0x190):  # of a drive, and of the I/O module
            harness.network.call(partial(harness.drive(2).send, cob_id, b"\1"))
        harness.master.start(10.0)
        assert harness.master.bus.counters.malformed == 0


def test_inputs_that_change_while_they_are_read_are_not_overwritten(
    open_rig: OpenRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    with open_rig(SMALL, enable=False) as harness:
        harness.robot.connection.stop_communication()
        node, module = harness.master.nodes[16], harness.module(16)
        read = node.sdo.read

        def slow(index: int, sub: int = 0) -> int:
            value = read(index, sub)
            if (index, sub) == (0x6000, 1):  # before the value is taken
                received = harness.master.bus.counters.received
                harness.network.call(partial(module.set_input, 0, 0x55))
                harness.until(lambda: harness.master.io.inputs[0] == 0x55)
                assert harness.master.bus.counters.received > received
            return value

        monkeypatch.setattr(node.sdo, "read", slow)
        harness.robot.connection.start_communication()
        assert harness.master.io.inputs[0] == 0x55


def test_inputs_that_change_while_a_module_is_lost(open_rig: OpenRig) -> None:
    with open_rig(SMALL, enable=False) as harness:
        harness.inject("16 silence")
        harness.until(lambda: not harness.robot.connection.ready)
        harness.inject("16 input 0 3 1")
        harness.inject("16 heal")
        harness.until(lambda: "event-driven" in harness.robot.connection.fault)
        harness.robot.connection.start_communication()
        assert harness.master.io.inputs[0] == 0b1000
        harness.inject("16 input 0 2 1")
        harness.until(lambda: harness.master.io.inputs[0] == 0b1100)


def test_a_node_that_was_started_just_now_is_not_taken_back(
    open_rig: OpenRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While others start, the control loop still counts it as lost."""
    with open_rig(SMALL, enable=False) as harness:
        harness.inject("16 reboot")
        harness.until(lambda: "lost its configuration" in harness.robot.connection.fault)
        node, start = harness.master.nodes[16], harness.master.io.start

        def later() -> None:
            cycles = harness.master._cycles
            harness.until(lambda: harness.master._cycles > cycles + 3)
            start()

        monkeypatch.setattr(harness.master.io, "start", later)
        harness.robot.connection.start_communication()
        assert node.configured
        assert node.fault == ""
        harness.inject("16 input 0 2 1")
        harness.until(lambda: harness.master.io.inputs[0] == 0b100)
