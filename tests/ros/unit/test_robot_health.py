"""Diagnostics of each part, and changes that are reported at once."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import pytest
from tests.fakes import FakeClock

from robotd.control.loop.period_timing import LoopReport
from robotd.device.bus_status import BusNode, BusState, BusStatus
from robotd.device.process_image import ProcessImage
from robotd.device.state import CommandMode, ConnectionState
from robotd.robot import Robot, build_robot
from robotd_ros.diagnostics.part_status import (
    DiagnosticLevel,
    PartStatus,
    axis_status,
    control_loop_status,
    engine_status,
    fieldbus_status,
    gripper_status,
)
from robotd_ros.diagnostics.robot_health import RECENT_S, Growth, Health

UP = ConnectionState.COMMUNICATING
ON_TIME = LoopReport(1000, 3, 1000, 500.0, 40.0, 130.0, 900.0, 100.0, 200.0, 300.0)
SECOND = 1_000_000_000


@pytest.mark.parametrize(
    ("state", "ready", "level"),
    [
        (ConnectionState.COMMUNICATING, True, DiagnosticLevel.OK),
        (
            ConnectionState.COMMUNICATING,
            False,
            DiagnosticLevel.WARN,
        ),  # parameters are being applied
        (ConnectionState.IDLE, False, DiagnosticLevel.WARN),
        (ConnectionState.RUNNING, False, DiagnosticLevel.WARN),
        (ConnectionState.SHUTDOWN, False, DiagnosticLevel.WARN),
        (ConnectionState.UNKNOWN, False, DiagnosticLevel.ERROR),
    ],
)
def test_the_engine(state: ConnectionState, ready: bool, level: DiagnosticLevel) -> None:
    status = engine_status(state, "sim", ready=ready)
    assert status.level is level
    assert status.values["state"] == state.value


OP = BusState.OPERATIONAL


def test_an_engine_without_fresh_values_says_why() -> None:
    status = engine_status(ConnectionState.UNKNOWN, "canopen", "the bus is off", ready=False)
    assert status.message == "the device gives no fresh values: the bus is off"


def test_an_engine_that_does_not_communicate_says_why() -> None:
    status = engine_status(ConnectionState.RUNNING, "wmx", "the licence has run out", ready=False)
    assert status.message == "Running: axes cannot be commanded: the licence has run out"


def test_the_device_adds_its_words_to_an_alarm() -> None:
    image = healthy()
    image.amp_alarm[0], image.alarm_code[0], image.reason[0] = True, 16, "DC link over-voltage"
    assert axis(image).message == "amplifier alarm 16 (DC link over-voltage)"


def test_what_else_a_fieldbus_knows_is_shown() -> None:
    network = BusStatus(OP, details={"bus load (%)": "23"})
    assert fieldbus_status("fieldbus", network, losing=False).values["bus load (%)"] == "23"


def healthy() -> ProcessImage:
    image = ProcessImage(1)
    image.offline[:], image.servo_on[:] = False, True
    image.position[:], image.position_command[:], image.velocity[:] = 1.0, 1.25, 0.5
    return image


def axis(image: ProcessImage, state: ConnectionState = UP, *, used: bool = True) -> PartStatus:
    return axis_status("joint1", 0, image, state, used=used)


def test_an_axis_that_is_well() -> None:
    status = axis(healthy())
    assert (status.level, status.message) == (DiagnosticLevel.OK, "servo on")
    assert status.values["position (rad or m)"] == "1"
    assert status.values["following error (rad or m)"] == "0.25"
    assert status.values["torque (N·m or N)"] == "not known"


@pytest.mark.parametrize(
    ("array", "value", "level", "message"),
    [
        ("offline", True, DiagnosticLevel.ERROR, "drive is offline"),
        ("amp_alarm", True, DiagnosticLevel.ERROR, "amplifier alarm 0"),
        ("negative_limit", True, DiagnosticLevel.WARN, "on the negative limit switch"),
        ("positive_limit", True, DiagnosticLevel.WARN, "on the positive limit switch"),
        ("servo_on", False, DiagnosticLevel.WARN, "servo off"),
    ],
)
def test_an_axis_that_is_not(array: str, value: bool, level: DiagnosticLevel, message: str) -> None:
    image = healthy()
    getattr(image, array)[0] = value
    status = axis(image)
    assert (status.level, status.message) == (level, message)


def test_the_worst_is_told_first() -> None:
    image = healthy()
    image.servo_on[0], image.amp_alarm[0], image.alarm_code[0] = False, True, 12
    status = axis(image)
    assert (status.level, status.message) == (DiagnosticLevel.ERROR, "amplifier alarm 12")
    assert status.values["alarm code"] == "12"


def test_a_bare_axis_may_be_off() -> None:
    image = healthy()
    image.servo_on[0] = False
    assert axis(image, used=False).level is DiagnosticLevel.OK


def test_only_in_position_mode_is_there_a_following_error() -> None:
    image = healthy()
    image.mode[0] = CommandMode.VELOCITY
    assert "following error (rad or m)" not in axis(image).values


@pytest.mark.parametrize("state", [state for state in ConnectionState if state is not UP])
def test_what_cannot_be_known_is_stale(state: ConnectionState) -> None:
    for status in (axis(ProcessImage(1), state), gripper_status(state, closed=False)):
        assert (status.level, status.values) == (DiagnosticLevel.STALE, {})
        assert state.value in status.message


def node(number: int, state: BusState = OP, **details: int | bool | str) -> BusNode:
    return BusNode(number, state, **details)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("nodes", "losing", "level", "message"),
    [
        ((node(0), node(1)), False, DiagnosticLevel.OK, "2 nodes operational"),
        (
            (node(0), node(1, BusState.INPUTS_ONLY)),
            False,
            DiagnosticLevel.WARN,
            "node 1 is inputs only",
        ),
        ((node(0),), True, DiagnosticLevel.WARN, "packets are being lost"),
        (
            (node(0, BusState.UNKNOWN, offline=True),),
            False,
            DiagnosticLevel.ERROR,
            "node 0 is offline",
        ),
        ((node(0, error_code=0x1B),), False, DiagnosticLevel.ERROR, "node 0 has error code 0x001b"),
        (
            (node(3, fault="EMCY 0x3210"),),
            False,
            DiagnosticLevel.ERROR,
            "node 3 has a fault: EMCY 0x3210",
        ),
        (
            (node(3, offline=True, fault="no heartbeat"),),
            False,
            DiagnosticLevel.ERROR,
            "node 3 is offline: no heartbeat",
        ),
        (
            (node(0, BusState.UNKNOWN, offline=True), node(1, BusState.CONFIGURABLE)),
            True,
            DiagnosticLevel.ERROR,
            "node 0 is offline; node 1 is configurable; packets are being lost",
        ),
    ],
)
def test_the_fieldbus(
    nodes: tuple[BusNode, ...], losing: bool, level: DiagnosticLevel, message: str
) -> None:
    status = fieldbus_status("fieldbus", BusStatus(OP, nodes=nodes), losing=losing)
    assert (status.level, status.message) == (level, message)


@pytest.mark.parametrize(
    ("report", "running", "missed", "level", "message"),
    [
        (ON_TIME, True, False, DiagnosticLevel.OK, "500 Hz"),
        (ON_TIME, True, True, DiagnosticLevel.WARN, "deadlines are being missed"),
        (ON_TIME, False, False, DiagnosticLevel.ERROR, "has stopped"),
        (
            LoopReport(0, 0, 0, math.nan, *[0.0] * 6),
            False,
            False,
            DiagnosticLevel.STALE,
            "not started",
        ),
        (
            LoopReport(9, 0, 9, 400.0, *[0.0] * 6),
            True,
            False,
            DiagnosticLevel.WARN,
            "400 Hz instead of 500 Hz",
        ),
    ],
)
def test_the_cycle(
    report: LoopReport, running: bool, missed: bool, level: DiagnosticLevel, message: str
) -> None:
    status = control_loop_status(report, 500.0, "none", running=running, missed=missed)
    assert (status.level, status.message) == (level, message)
    assert status.values["missed deadlines"] == str(report.missed)
    assert status.values["late setpoints"] == str(report.late_setpoints)


def test_growth_is_remembered_for_a_while() -> None:
    growth, while_ns = Growth(), int(RECENT_S * SECOND)
    assert not growth.is_recent(0, SECOND)
    assert growth.is_recent(1, 2 * SECOND)
    assert growth.is_recent(1, 2 * SECOND + while_ns - 1)
    assert not growth.is_recent(1, 2 * SECOND + while_ns)
    assert not growth.is_recent(0, 9 * SECOND)  # it was reset
    assert growth.is_recent(1, 10 * SECOND)


@pytest.fixture
def robot() -> Iterator[Robot]:
    """The arm on the simulation with a clock that nobody moves, up, without a running cycle."""
    robot = build_robot("cr3a", "sim", clock=FakeClock())
    robot.connection.start()
    robot.control_loop.step(robot.clock.now_ns())
    yield robot
    robot.connection.shutdown()


def levels(health: Health) -> dict[str, DiagnosticLevel]:
    return {status.part: status.level for status in health.statuses()}


def test_a_robot_tells_of_all_its_parts(robot: Robot) -> None:
    assert levels(Health(robot)) == {
        "engine": DiagnosticLevel.OK,
        **dict.fromkeys(robot.joint_names, DiagnosticLevel.WARN),  # servos are off
        "fieldbus": DiagnosticLevel.OK,
        "cycle": DiagnosticLevel.STALE,
        "motion": DiagnosticLevel.OK,
        "gripper": DiagnosticLevel.OK,
    }


def test_an_idle_engine_leaves_nothing_known(robot: Robot) -> None:
    health = Health(robot)
    robot.connection.close()
    found = levels(health)
    assert found.pop("engine") is DiagnosticLevel.WARN
    assert found.pop("motion") is DiagnosticLevel.OK
    assert set(found.values()) == {DiagnosticLevel.STALE}


@pytest.mark.parametrize(
    "change",
    [
        lambda robot: robot.image.servo_on.__setitem__(2, True),
        lambda robot: robot.image.amp_alarm.__setitem__(5, True),
        lambda robot: robot.image.offline.__setitem__(0, True),
        lambda robot: robot.image.positive_limit.__setitem__(1, True),
        lambda robot: robot.gripper.command(True),
        lambda robot: robot.connection.close(),
    ],
)
def test_what_changes_is_noticed(robot: Robot, change: Callable[[Robot], object]) -> None:
    health = Health(robot)
    before = health.fingerprint()
    assert health.fingerprint() == before
    change(robot)
    assert health.fingerprint() != before


def test_an_alarm_of_the_controller_is_an_error_of_the_engine_told_once() -> None:
    image = healthy()
    image.set_controller_alarm(17, "emergency stop")
    assert image.controller_fault == "controller alarm 17 (emergency stop)"
    assert axis(image).message == "controller alarm 17"
    status = engine_status(UP, "acme", image.controller_fault, ready=True)
    assert (status.level, status.message) == (
        DiagnosticLevel.ERROR,
        "controller alarm 17 (emergency stop)",
    )
    image.set_controller_alarm(0)
    assert image.controller_fault == ""
    assert not image.amp_alarm.any()


def test_a_managed_robot_that_is_not_active_is_a_warning(robot: Robot) -> None:
    health = Health(robot)
    before = health.fingerprint()
    robot.axes.stop_latch.inactive = "inactive"
    assert health.fingerprint() != before
    [motion] = [status for status in health.statuses() if status.part == "motion"]
    assert (motion.level, motion.message) == (
        DiagnosticLevel.WARN,
        "not allowed: the robot is inactive",
    )
