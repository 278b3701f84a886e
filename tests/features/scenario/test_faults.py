"""Every fault in a scenario: what it does to a robot that is being moved."""

from __future__ import annotations

from typing import Any

import pytest
from tests.core.control.harness import Harness
from tests.features.scenario.harness import MOVE, run

from robotd.errors import DescriptorError, InvalidArgument
from robotd_scenario import FAULTS, FaultSchedule, requested_fault, validate_fault

BACK = {"move": {"to_rad": {"joint1": 0.0}, "time_s": 1.0}}
SERVOS_ON = {"servos": "on"}


def failed(reason: str) -> dict[str, Any]:
    return {**MOVE, "expect": "fault", "reason": reason}


def check(**values: Any) -> dict[str, Any]:
    return {"check": values}


CASES: dict[str, tuple[dict[str, Any], list[dict[str, Any]]]] = {
    "amp_alarm": (
        {"at_s": 0.5, "amp_alarm": {"axis": 0, "code": 77}},
        [failed("joint1 at 0.49"), check(alarms=[0], servos_on=[1]), SERVOS_ON, BACK],
    ),
    "following_error": (
        {"at_s": 0.4, "following_error": {"axis": 0, "for_s": 1.0}},
        [{**MOVE, "expect": "path_tolerance", "reason": "joint1"}, {"wait_s": 1.0}, BACK],
    ),
    "slave_lost": (
        {"at_s": 0.5, "slave_lost": {"axis": 1, "for_s": 0.3}},
        [failed("joint2"), check(offline=[1]), check(offline=[], within_s=1.0), SERVOS_ON, BACK],
    ),
    "packet_loss": (
        {"at_s": 0.5, "packet_loss": {"count": 300}},
        [failed("ms old"), check(engine="Communicating", within_s=1.0), BACK],
    ),
    "late_cycles": (
        {"at_s": 0.5, "late_cycles": {"late_s": 0.3, "count": 1}},
        [failed("joint1"), BACK],
    ),
    "stuck_gripper": (
        {"stuck_gripper": {"closed": False, "for_s": 1.0}},
        [
            {"wait_s": 0.1},
            {"gripper": "closed"},
            {"wait_s": 0.5},
            check(gripper="open"),
            {"wait_s": 0.5},
            {"gripper": "closed"},
            check(gripper="closed", within_s=0.3),
        ],
    ),
    "input_bit": (
        {"at_s": 0.2, "input_bit": {"byte": 1, "bit": 2, "value": True, "for_s": 0.5}},
        [{"wait_s": 1.0}],
    ),
    "encoder_jump": (
        {"at_s": 0.5, "encoder_jump": {"axis": 0, "delta_rad": 1.5}},
        [{**MOVE, "expect": "path_tolerance"}, {"wait_s": 0.5}, BACK],
    ),
    "moved_by_hand": (
        {"at_s": 0.5, "moved_by_hand": {"axis": 0, "delta_rad": 0.3}},
        [{"servos": "off"}, {"wait_s": 1.0}, SERVOS_ON, check(joints_rad={"joint1": 0.3}), BACK],
    ),
    "communication_drop": (
        {"at_s": 0.5, "communication_drop": {}},
        [
            failed("engine state Running"),
            check(engine="Running"),
            {"engine": "on"},
            SERVOS_ON,
            BACK,
        ],
    ),
    "engine_stopped": (
        {"at_s": 0.5, "engine_stopped": {}},
        [failed("engine state Idle"), check(engine="Idle"), {"engine": "on"}, SERVOS_ON, BACK],
    ),
}


def test_every_kind_is_tested() -> None:
    assert tuple(CASES) == FAULTS


@pytest.mark.parametrize("kind", FAULTS)
def test_a_fault_does_what_it_says_and_the_robot_recovers(kind: str) -> None:
    fault, program = CASES[kind]
    result = run(*program, faults=[fault])
    assert result.failures == []
    assert [fault.fault.name for fault in result.faults if not fault.over] == [kind]
    assert result.faults[0].time_s == pytest.approx(fault.get("at_s", 0.0), abs=0.003)


@pytest.mark.parametrize("kind", sorted(set(FAULTS) - {"stuck_gripper", "input_bit"}))
def test_without_the_fault_the_same_program_fails(kind: str) -> None:
    """So that the cases above can fail."""
    assert run(*CASES[kind][1]).failures


def test_a_short_loss_of_packets_is_survived() -> None:
    result = run(MOVE, check(joints_rad={"joint1": 1.0}),
                 faults=[{"at_s": 0.5, "packet_loss": {"count": 20}}])  # fmt: skip
    assert result.failures == []


def test_late_periods_are_survived_one_after_the_other() -> None:
    late = {"at_s": 0.3, "late_cycles": {"late_s": 0.005, "count": 50}}
    assert run(MOVE, check(joints_rad={"joint1": 1.0}), faults=[late]).failures == []


def test_a_fault_at_a_place() -> None:
    when = {"joint": "joint1", "above_rad": 0.5}
    result = run(failed("joint1"), faults=[{"when": when, "amp_alarm": {"axis": 1}}])
    assert "joint2" in result.failures[0]
    result = run({**MOVE, "expect": "fault"}, faults=[{"when": when, "amp_alarm": {"axis": 1}}])
    assert result.failures == []
    assert 0.4 < result.faults[0].time_s < 0.6


def test_a_fault_that_never_happens_is_a_failure() -> None:
    when = {"joint": "joint2", "below_rad": -1.0}
    result = run(MOVE, faults=[{"when": when, "amp_alarm": {"axis": 1}}])
    assert result.failures == ["amp_alarm axis=1 code=8976: did not happen"]


def test_a_blocked_axis_stays_where_it_is_while_others_rest() -> None:
    result = run(
        {**MOVE, "expect": "path_tolerance"},
        {"wait_s": 5.0},
        check(joints_rad={"joint1": 0.5}, tolerance_rad=0.1),
        faults=[{"at_s": 0.5, "following_error": {"axis": 0}}],
    )
    assert result.failures == []


@pytest.mark.parametrize("for_s", [{}, {"for_s": 2.0}], ids=["for ever", "for 2 s"])
def test_a_fault_lasts_as_long_as_the_longest_of_its_kind(for_s: dict[str, float]) -> None:
    blocked = [
        {"following_error": {"axis": 0, **for_s}},
        {"at_s": 0.2, "following_error": {"axis": 0, "for_s": 0.3}},
        {"at_s": 0.2, "following_error": {"axis": 0, "for_s": 0.3}},
    ]
    result = run({"wait_s": 1.0}, {**MOVE, "expect": "path_tolerance"}, faults=blocked)
    assert result.failures == []


def test_faults_that_end_together_end() -> None:
    blocked = {"following_error": {"axis": 0, "for_s": 0.3}}
    assert run({"wait_s": 0.5}, MOVE, faults=[blocked, blocked]).failures == []


@pytest.mark.parametrize("other", [{"packet_loss": {"count": 400}}, {"communication_drop": {}}])
def test_a_slave_is_back_when_the_device_is_ready_again(other: dict[str, Any]) -> None:
    result = run(
        {"wait_s": 0.6},
        {"engine": "on", "expect": "ok"},
        check(offline=[], within_s=1.0),
        faults=[{"slave_lost": {"axis": 1, "for_s": 0.4}}, {"at_s": 0.2, **other}],
    )
    assert result.failures == []


def test_a_slave_that_is_back_brings_no_other_one_back() -> None:
    result = run(
        {"wait_s": 1.0},
        check(offline=[1]),
        check(offline=[], within_s=2.0),
        faults=[{"slave_lost": {"axis": 0, "for_s": 0.5}}, {"slave_lost": {"axis": 1, "for_s": 2}}],
    )
    assert result.failures == []


@pytest.mark.parametrize(
    ("fault", "text"),
    [
        ({"amp_alarm": {"axis": 2}}, "axis 2 is outside 0..1"),
        ({"when": {"joint": "j9", "above_rad": 0}, "engine_stopped": {}}, "unknown joint 'j9'"),
    ],
)
def test_a_fault_that_does_not_fit_the_robot_is_rejected(fault: dict[str, Any], text: str) -> None:
    with pytest.raises(InvalidArgument, match=text):
        run(faults=[fault])


@pytest.mark.parametrize(
    ("kind", "settings", "text"),
    [
        ("", {}, "unknown fault ''"),
        ("at_s", {"axis": 1}, "unknown fault 'at_s'"),
        ("amp_alarmm", {"axis": 1}, "unknown fault 'amp_alarmm'; did you mean 'amp_alarm'?"),
        ("amp_alarm", {"axs": 1}, "amp_alarm.axs: unknown key; did you mean 'axis'?"),
        ("amp_alarm", {"axis": 1, "code": 0}, "amp_alarm.code: must be at least 1"),
        ("following_error", {"axis": 1, "for_s": 1e300}, "must be at most 1e\\+06"),
        ("encoder_jump", {"axis": 1, "delta_rad": 1e300}, "must be at most 1e\\+06"),
        ("engine_stopped", {"at_s": float("nan")}, "at_s: must be"),
        ("engine_stopped", {"when": 1.0}, "engine_stopped.when: unknown key"),
        ("engine_stopped", {"when.joint": "a"}, "one of above_rad and below_rad"),
    ],
)
def test_a_request_that_is_no_fault_is_rejected(
    kind: str, settings: dict[str, Any], text: str
) -> None:
    with pytest.raises((DescriptorError, InvalidArgument), match=text.replace("?", r"\?")):
        requested_fault(kind, settings)


def test_a_requested_fault_is_that_of_a_file() -> None:
    settings = {"axis": 2, "at_s": 1.5, "when.joint": "a", "when.above_rad": 1.0}
    when = {"joint": "a", "above_rad": 1.0}
    written = {"at_s": 1.5, "when": when, "amp_alarm": {"axis": 2}}
    assert requested_fault("amp_alarm", settings) == validate_fault(written)


def bit(value: bool, at_s: float, for_s: float) -> dict[str, Any]:
    fault = {"byte": 1, "bit": 2, "value": value, "for_s": for_s}
    return {"at_s": at_s, "input_bit": fault}


@pytest.mark.parametrize("before", [False, True])
@pytest.mark.parametrize(
    ("faults", "levels"),
    [
        ([bit(True, 0.1, 0.2)], "b1bbb"),
        ([bit(False, 0.1, 0.2)], "b0bbb"),
        ([bit(True, 0.1, 0.6), bit(False, 0.3, 0.2)], "b101b"),  # at 0.2, 0.4, 0.6
        ([bit(True, 0.1, 0.4), bit(False, 0.3, 0.4)], "b100b"),
        ([bit(True, 0.1, 0.4), bit(True, 0.3, 0.4)], "b111b"),
        ([bit(True, 0.1, 0.6), bit(True, 0.3, 0.2)], "b111b"),
    ],
)
def test_an_input_is_as_before_when_the_last_of_its_faults_is_over(
    before: bool, faults: list[dict[str, Any]], levels: str
) -> None:
    arm = Harness()
    schedule = FaultSchedule(arm.robot, [validate_fault(fault) for fault in faults])
    arm.up()
    arm.robot.fault_injector.set_input_bit(1, 2, before)
    schedule.begin()
    seen = []
    for _ in range(5):
        seen.append(arm.robot.io.input_bit(1, 2))
        arm.run(0.2)
    expected = [before if level == "b" else level == "1" for level in levels]
    assert seen == expected
    assert len(schedule.happened) == 2 * len(faults)
    assert not schedule.failures()


def test_a_gripper_that_is_stuck_twice_is_stuck_as_the_fault_that_lasts() -> None:
    stuck = [
        {"stuck_gripper": {"closed": True}},
        {"at_s": 0.3, "stuck_gripper": {"closed": False, "for_s": 0.5}},
    ]
    program = [{"wait_s": 1.2}, check(gripper="closed")]
    assert run(*program, faults=stuck).failures == []
    assert run({"wait_s": 0.7}, check(gripper="open"), faults=stuck).failures == []
