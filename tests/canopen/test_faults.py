"""Every fault during a trajectory: a controlled stop, a reason, a live daemon, a way back."""

from __future__ import annotations

import numpy as np
import pytest
from tests.canopen.conftest import SMALL, OpenRig
from tests.canopen.rig import Rig

from robotd.cycle.execution import Execution, Outcome
from robotd.device.state import EngineState
from robotd.errors import ConnectError, DeviceTimeout


def broken(rig: Rig, line: str) -> Execution:
    """A trajectory during which ``line`` happens; returns when all axes stand."""
    with rig.robot.follower.follow(rig.request(1.5, 0.8)) as execution:
        rig.until(lambda: rig.image.position[0] > 0.2)
        rig.inject(line)
        assert execution.wait(5)
    healthy = [0, 1, 3, 4, 5]
    rig.until(lambda: not rig.image.operation[healthy].any())
    rig.until(lambda: bool((np.abs(rig.image.velocity[healthy]) < 0.01).all()))
    assert rig.image.servo_on[healthy].all()
    return execution


def recover(rig: Rig) -> None:
    """What an operator does."""
    rig.inject("3 heal")
    rig.robot.engine.start_communication()
    rig.until(lambda: rig.robot.engine.ready and not rig.image.offline.any())
    rig.robot.enable_joints()
    assert rig.follow(0.5, 0.1).outcome is Outcome.SUCCEEDED


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("3 silence", "joint3 (node 3): TPDO"),
        ("3 reboot", "joint3 (node 3)"),
        ("3 drop 1.0", "joint3 (node 3): TPDO"),
    ],
)
def test_a_lost_drive(open_rig: OpenRig, line: str, reason: str) -> None:
    with open_rig() as rig:
        execution = broken(rig, line)
        assert execution.outcome is Outcome.FAULT
        assert reason in execution.message
        assert rig.robot.engine.state is EngineState.UNKNOWN
        assert not rig.robot.engine.ready
        assert rig.image.offline[2]
        recover(rig)


@pytest.mark.parametrize("line", ["3 trip 0x3210", "3 block"])
def test_a_drive_that_trips(open_rig: OpenRig, line: str) -> None:
    options = {"startup": [{"object": "0x6065", "value": 2000}]}
    defaults = {"counts_per_rad": 1e5, **options}
    with open_rig(axis_defaults=defaults) as rig:
        execution = broken(rig, line)
        assert execution.outcome is Outcome.FAULT
        assert "joint3" in execution.message
        code = 0x3210 if "trip" in line else 0x8611
        assert rig.image.alarm_code[2] == code
        note = rig.robot.fieldbus.network_state(0).note
        assert f"node 3: EMCY 0x{code:04X}" in note
        recover(rig)


def test_a_statusword_that_lies_is_not_switched_on_again(open_rig: OpenRig) -> None:
    with open_rig(engine={"servo_timeout_s": 1.0}) as rig:
        execution = broken(rig, "3 statusword 0x0250")
        assert execution.outcome is Outcome.FAULT
        assert "joint3" in execution.message
        assert not rig.image.servo_on[2]
        with pytest.raises(ConnectError, match=r"joint3 \(node 3\).*statusword 0x0250"):
            rig.robot.enable_joints()
        recover(rig)


def test_late_and_some_lost_pdos_are_lived_with(open_rig: OpenRig) -> None:
    with open_rig(SMALL) as rig:
        rig.inject("1 drop 0.2")
        rig.inject("2 late 0.002")
        assert rig.follow(0.8, 0.4).outcome is Outcome.SUCCEEDED


def test_an_emergency_is_kept(open_rig: OpenRig) -> None:
    with open_rig(SMALL, enable=False) as rig:
        rig.inject("2 emcy 0xFF12")
        rig.until(lambda: bool(rig.master.emergencies.history))
        assert "0xFF12 (vendor specific)" in str(rig.master.emergencies.history[-1])


def test_sdo_faults_name_node_step_object_and_code(open_rig: OpenRig) -> None:
    with open_rig(enable=False, sdo_timeout_s=0.05) as rig:
        rig.robot.engine.stop_communication()
        for line in ("2 abort 0x1017 0x06090030", "3 timeout 0x1A00", "4 identity 0x99"):
            rig.inject(line)
        with pytest.raises(ConnectError) as caught:
            rig.robot.engine.start_communication()
        text = str(caught.value)
        assert "joint2 (node 2)" in text
        assert "writing 0x1017:00 (Producer heartbeat time)" in text
        assert "abort 0x06090030, value range of parameter exceeded" in text
        assert "joint3 (node 3)" in text
        assert "no answer within 0.05 s, 3 tries" in text
        assert "joint1" not in text
        for node in (2, 3):
            rig.inject(f"{node} heal")
        rig.robot.engine.start_communication()
        assert rig.robot.engine.ready


def test_a_wrong_identity_is_refused(open_rig: OpenRig) -> None:
    identity = {"vendor_id": 0x1234}
    defaults = {"counts_per_rad": 1e5, "identity": identity}
    with open_rig(axis_defaults=defaults, enable=False) as rig:
        rig.robot.engine.close()
        rig.device._simulate()
        rig.inject("2 identity 0x4321")
        with pytest.raises(ConnectError, match=r"vendor_id.*is 0x00004321, expected is 0x00001234"):
            rig.robot.engine.open()


def test_partial_bring_up_when_it_is_allowed(open_rig: OpenRig) -> None:
    with open_rig(enable=False, allow_partial=True, sdo_timeout_s=0.05) as rig:
        rig.robot.engine.stop_communication()
        rig.inject("6 silence")
        rig.robot.engine.start_communication()
        assert rig.robot.engine.ready
        rig.until(lambda: list(rig.image.offline) == [False] * 5 + [True])


def test_the_drives_stop_when_the_daemon_is_gone(open_rig: OpenRig) -> None:
    with open_rig() as rig:
        rig.robot.cycle.stop()
        drives = [rig.drive(node).drives[0] for node in range(1, 7)]
        rig.until(lambda: all(drive.get(0x603F) == 0x8130 for drive in drives))
        rig.master.state = EngineState.RUNNING  # nobody is left who could stop it in order


def test_a_bus_that_goes_away(open_rig: OpenRig) -> None:
    with open_rig(SMALL) as rig:
        rig.master.bus._can.shutdown()  # type: ignore[union-attr]
        rig.until(lambda: not rig.robot.engine.ready)
        assert any("failed" in fault for fault in rig.master.faults)
        rig.robot.engine.start_communication()
        rig.until(lambda: rig.robot.engine.ready and not rig.image.offline.any())
        rig.robot.enable_joints()
        assert rig.follow(0.5, 0.1).outcome is Outcome.SUCCEEDED


def test_a_servo_that_does_not_go_on_says_why(open_rig: OpenRig) -> None:
    with open_rig(SMALL, enable=False) as rig:
        rig.inject("1 statusword 0x0250")
        with pytest.raises(DeviceTimeout, match=r"shoulder \(node 1\).*switch on disabled"):
            rig.robot.axes._driver.servo(0, True, 0.2)
