"""Bringing nodes up: every failure is reported with node, step, object and abort code."""

from __future__ import annotations

import pytest
from tests.plugins.canopen.bus.conftest import SMALL, OpenRig

from robotd.errors import ConnectError, NotReady
from robotd_canopen.bus_scan import scan_bus


def test_sdo_faults_name_node_step_object_and_code(open_rig: OpenRig) -> None:
    with open_rig(enable=False, sdo_timeout_s=0.15) as harness:
        harness.robot.connection.stop_communication()
        for line in ("2 abort 0x1017 0x06090030", "3 timeout 0x1A00"):
            harness.inject(line)
        with pytest.raises(ConnectError) as caught:
            harness.robot.connection.start_communication()
        text = str(caught.value)
        assert "joint2 (node 2): heartbeat: " in text
        assert "writing 0x1017:00 (Producer heartbeat time)" in text
        assert "abort 0x06090030, value range of parameter exceeded" in text
        assert "joint3 (node 3): PDO configuration: " in text
        assert "no answer within 0.15 s, 3 tries" in text
        assert "joint1" not in text
        assert text.count("joint2 (node 2)") == 1
        for node in (2, 3):
            harness.inject(f"{node} heal")
        harness.robot.connection.start_communication()
        assert harness.robot.connection.ready


def test_a_node_that_does_not_start_says_what_it_knows(
    open_rig: OpenRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    with open_rig(SMALL, enable=False) as harness:
        harness.robot.connection.stop_communication()
        drive = harness.drive(2)
        harness.inject("2 reboot")
        harness.network.call(lambda: drive.emergency(0x8130, 0x11))
        obey = drive.on_nmt
        monkeypatch.setattr(
            drive, "on_nmt", lambda data, now_ns: obey(data, now_ns) if data[0] != 1 else None
        )
        expected = (
            r"NMT start: not operational within 2 s: it is pre-operational, its last boot-up"
            r" message came \d\.\d s ago, error register 0x1001 is 0x11 \(generic, communication\),"
            r" latest error 0x1003:01 is 0x8130 life guard or heartbeat error"
        )
        with pytest.raises(ConnectError, match=expected):
            harness.robot.connection.start_communication()


def test_a_drive_that_resets_while_it_is_configured_does_not_start(
    open_rig: OpenRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It would send its own PDOs, and sends heartbeats by default."""
    with open_rig(SMALL, enable=False) as harness:
        harness.robot.connection.stop_communication()
        drive, node = harness.drive(2), harness.master.nodes[2]
        start, booted_ns = node.start, node.boot_ns

        def reset_before() -> None:
            harness.inject("2 reboot")
            harness.network.call(lambda: drive.values.update({(0x1017, 0): 100}))
            harness.until(lambda: node.boot_ns != booted_ns)
            start()

        with monkeypatch.context() as patch:
            patch.setattr(node, "start", reset_before)
            with pytest.raises(ConnectError, match=r"elbow \(node 2\): NMT start: it was reset"):
                harness.robot.connection.start_communication()
        harness.robot.connection.start_communication()
        assert harness.robot.connection.ready


def test_a_wrong_identity_is_rejected(open_rig: OpenRig) -> None:
    identity = {"vendor_id": 0x1234}
    defaults = {"counts_per_rad": 1e5, "identity": identity}
    with open_rig(SMALL, axis_defaults=defaults, enable=False) as harness:
        harness.robot.connection.close()
        harness.power_on()
        harness.inject("2 identity 0x4321")
        with pytest.raises(ConnectError, match=r"vendor_id.*is 0x00004321, expected is 0x00001234"):
            harness.robot.connection.open()


def test_two_nodes_with_one_id_are_rejected(open_rig: OpenRig) -> None:
    with open_rig(SMALL, enable=False) as harness:
        harness.robot.connection.close()
        with harness.second_network(), pytest.raises(ConnectError, match="duplicate node id"):
            harness.robot.connection.open()
        harness.robot.connection.open()
        with harness.second_network():
            found = scan_bus("virtual", harness.master.bus.name, 1_000_000, 0.3)
        assert [node.number for node in found] == [1, 2, 3, 16]
        assert all("DUPLICATE ID" in str(node) for node in found)


def test_partial_bring_up_when_it_is_allowed(open_rig: OpenRig) -> None:
    with open_rig(enable=False, allow_partial=True, sdo_timeout_s=0.15) as harness:
        harness.robot.connection.stop_communication()
        harness.inject("6 silence")
        harness.robot.connection.start_communication()
        assert harness.robot.connection.ready
        harness.until(lambda: list(harness.image.offline) == [False] * 5 + [True])
        assert "no answer" in harness.image.reason[5]
        harness.inject("6 heal")
        harness.robot.connection.stop_communication()
        harness.robot.connection.start_communication()
        harness.until(lambda: not harness.image.offline.any())


def test_an_io_module_that_is_missing_is_not_left_out(open_rig: OpenRig) -> None:
    """Its inputs would read as 0, and nothing shows that they are not known."""
    with open_rig(SMALL, enable=False, allow_partial=True, sdo_timeout_s=0.15) as harness:
        harness.robot.connection.stop_communication()
        harness.inject("16 silence")
        with pytest.raises(ConnectError, match=r"I/O module \(node 16\).*no answer"):
            harness.robot.connection.start_communication()
        assert not harness.robot.connection.ready
        harness.inject("16 heal")
        harness.robot.connection.start_communication()
        assert harness.robot.connection.ready


def test_outputs_stay_on_when_a_lost_drive_delays_the_restart(open_rig: OpenRig) -> None:
    with open_rig(enable=False, sdo_timeout_s=0.15) as harness:
        harness.inject("2 silence")
        harness.inject("16 reboot")
        nodes = harness.master.nodes
        harness.until(lambda: not nodes[2].online and not nodes[16].online)
        harness.module(16).values[0x6200, 1] = 0b1000  # switched on by hand
        with pytest.raises(ConnectError, match="joint2"):
            harness.robot.connection.start_communication()
        harness.inject("2 heal")
        harness.robot.connection.start_communication()
        harness.robot.io.set_output_bit(0, 0, True)
        harness.until(lambda: harness.module(16).outputs[0] == 0b1001)


def test_no_output_is_sent_before_those_of_a_module_are_known(open_rig: OpenRig) -> None:
    """A frame has all of them: those of before the reset would be switched on."""
    with open_rig(SMALL, enable=False, sdo_timeout_s=0.15) as harness:
        nodes, io = harness.master.nodes, harness.master.io
        harness.robot.io.set_output_bit(0, 0, True)
        harness.inject("2 silence")
        harness.inject("16 reboot")
        harness.until(lambda: not nodes[2].online and not nodes[16].online)
        with pytest.raises(ConnectError, match="elbow"):
            harness.robot.connection.start_communication()
        assert nodes[16].online
        with pytest.raises(
            NotReady, match=r"I/O module \(node 16\): its outputs are not known yet"
        ):
            io.write_output_bit(0, 3, True)
        harness.inject("2 heal")
        harness.robot.connection.start_communication()
        harness.robot.io.set_output_bit(0, 3, True)
        harness.until(lambda: harness.module(16).outputs[0] == 0b1000)
