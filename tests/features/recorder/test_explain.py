"""``robotd explain`` of what really was recorded."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from tests.features.harness import Observed
from tests.features.recorder.frames import PERIOD_NS, ramp, write

from robotd.cli import main
from robotd.events import Event, EventKind, sent_by
from robotd_cia402.code_tables import EMERGENCIES
from robotd_recorder.explanation import explain as explained
from robotd_recorder.explanation import find_incident
from robotd_recording.recording_reader import read_recording
from robotd_sim.code_tables import DRIVE_ALARMS


@pytest.fixture(scope="module")
def fault(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Recording of an alarm of joint 3, 0.4 s after the start of a goal of /move_group."""
    arm = Observed(tmp_path_factory.mktemp("explain"))
    with sent_by("/panel"):
        arm.robot.axes.servo(5, False)
        arm.robot.axes.servo(5, True)
    with sent_by("/move_group"), arm.goal([0.3] * 6):
        arm.step(0.4)
        arm.robot.fault_injector.trip(2, 0x8611)
        arm.step(0.3)
    arm.step(0.6)
    arm.flight.close()
    (path,) = arm.files()
    yield path
    arm.close()


def explain(*arguments: str | Path) -> Result:
    return CliRunner().invoke(main, ["explain", *map(str, arguments)])


def test_the_root_cause_comes_first_with_values_limits_and_the_client(fault: Path) -> None:
    result = explain(fault)
    assert result.exit_code == 0, result.output
    head, _, events = result.output.partition("Events\n")
    title, _, heading, cause, *details = head.splitlines()
    assert title.startswith("cr3a (intel) on sim, ")
    assert heading == "Root cause"
    assert cause == "  joint3: amplifier alarm 34321 (following error)"
    text = "\n".join(details)
    assert "CANopen emergency, CiA 402 error code 0x8611: following error" in text
    assert "limits -2.86 to 2.86 rad" in text
    assert "limit 3.14 rad/s" in text
    assert "commanded by /move_group, 0.4" in text
    assert "goal of 1 point over 1.000 s" in text
    lines = events.splitlines()
    order = ["servo: joint6, off  [/panel]", "goal of 1 point", "* ", "goal fault: joint3 at"]
    places = [next(i for i, line in enumerate(lines) if part in line) for part in order]
    assert places == sorted(places)


def test_the_first_fault_is_the_cause_and_not_what_followed_from_it(fault: Path) -> None:
    incident = find_incident(read_recording(fault))
    assert incident.cause is not None
    assert incident.cause.kind == "fault"
    bad = [event for event in incident.events if event.kind == "result"]
    assert bad[0].time_ns > incident.cause.time_ns


def test_the_cause_is_the_fault_that_the_file_was_saved_for(tmp_path: Path) -> None:
    arm = Observed(tmp_path)
    for _ in range(2):
        arm.robot.fault_injector.trip(2, 0x8611)
        arm.step(2.0)
        arm.robot.axes.clear_alarm(2)
        arm.step(0.5)
        arm.flight.close()
    newest = arm.flight.last
    arm.close()
    assert newest is not None
    recording = read_recording(newest)
    faults = [event for event in recording.events if event.kind == "fault"]
    assert faults[0].text == faults[1].text
    assert find_incident(recording).cause == faults[1]


def test_the_picture_is_written(fault: Path, tmp_path: Path) -> None:
    picture = tmp_path / "fault.png"
    result = explain(fault, "--plot", picture)
    assert result.exit_code == 0, result.output
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("name", "reason"),
    [("missing/fault.png", "No such file or directory"), ("fault.xyz", "Format 'xyz' is not")],
)
def test_a_picture_that_cannot_be_written_is_one_usage_error(
    fault: Path, tmp_path: Path, name: str, reason: str
) -> None:
    result = explain(fault, "--plot", tmp_path / name)
    assert (result.exit_code, result.stdout) == (2, "")
    assert f"Invalid value for '--plot': {tmp_path / name}: {reason}" in result.stderr
    assert "Errno" not in result.stderr


@pytest.mark.parametrize(
    ("code", "meaning"),
    [
        ("0x8611", "CANopen emergency, CiA 402 error code 0x8611: following error"),
        ("34321", "alarm of a simulated drive 0x8611: following error"),
        ("8611", "CANopen emergency, CiA 402 error code 0x8611: following error"),
        ("0x86FF", "CANopen emergency, CiA 402 error code 0x86FF: position control"),
        ("0x06090011", "CANopen SDO abort 0x06090011: subindex does not exist"),
        ("-4", "result of a trajectory goal -4: PATH_TOLERANCE_VIOLATED"),
    ],
)
def test_codes_of_every_table_are_explained(code: str, meaning: str) -> None:
    result = explain("--", code)
    assert result.exit_code == 0, result.output
    assert meaning in result.output


def test_every_known_code_of_a_drive_comes_with_what_to_do() -> None:
    for table in (DRIVE_ALARMS, EMERGENCIES):
        for code in table.texts:
            if 0x1000 < code < 0xFF00:
                assert table.advice(code), hex(code)
    assert "Look for a blocked axis" in explain("0x8611").output
    assert "EDS of the drive" in explain("0x06090011").output
    assert "path tolerance" in explain("--", "-4").output
    assert DRIVE_ALARMS.advice(0xFF01) == DRIVE_ALARMS.advice(0) == ""


def test_an_unknown_code_is_said_to_be_unknown() -> None:
    result = explain("0x7FFFFFFF")
    assert result.exit_code == 1
    assert "in no table" in result.output
    assert explain("nonsense").exit_code == 2


def test_an_alarm_without_a_code_is_not_explained_as_a_goal_that_was_reached(
    tmp_path: Path,
) -> None:
    data = {"axis": 1, "code": 0}
    alarm = Event(PERIOD_NS, EventKind.FAULT, "joint2", "joint2: amplifier alarm 0", data=data)
    write(tmp_path / "x.mcap", ramp(), events=[alarm])
    output = explain(tmp_path / "x.mcap").output
    assert "joint2: amplifier alarm 0" in output
    assert "SUCCESSFUL" not in output


def test_a_missing_recording_is_named(tmp_path: Path) -> None:
    result = explain(tmp_path / "none.mcap")
    assert result.exit_code == 3
    assert "none.mcap: No such file" in result.output


def test_a_prismatic_joint_has_its_units(fault: Path) -> None:
    recording = read_recording(fault)
    info = replace(recording.info, units={**recording.info.units, "joint3": "m"})
    text = "\n".join(explained(replace(recording, info=info)))
    for part in ("limits -2.86 to 2.86 m", " m, command ", "limit 3.14 m/s", "  force "):
        assert part in text
    assert recording.info.units == {f"joint{number}": "rad" for number in range(1, 7)}


def test_the_client_is_one_that_commanded_the_axis(fault: Path) -> None:
    recording = read_recording(fault)
    cause = find_incident(recording).cause
    assert cause is not None
    info = replace(recording.info, joints=(0, 1, 2, 3, 4))  # joint6 is a wheel
    of_others = [
        (EventKind.GOAL, "trajectory", "goal", {"joints": ["joint1"]}),
        (EventKind.COMMAND, "command", "command: linear_m_s 0.1, angular_rad_s 0", {}),
        (EventKind.COMMAND, "jog", "jog: joint1 at +0.1000/s", {}),
    ]
    events = [
        *recording.events,
        *(
            Event(cause.time_ns - 1000, kind, subject, text, sender="/other", data=data)
            for kind, subject, text, more in of_others
            for data in [{"outcome": "accepted", **more}]
        ),
    ]
    events.sort(key=lambda event: event.time_ns)

    def text_of(subject: str) -> str:
        found = [replace(event, subject=subject) if event is cause else event for event in events]
        return "\n".join(explained(replace(recording, info=info, events=tuple(found))))

    assert "  commanded by /move_group, 0.4" in text_of("joint3")
    assert "  commanded by /other, 0.000 s before: jog: joint1" in text_of("joint1")
    assert "  commanded by /other, 0.000 s before: command: linear" in text_of("joint6")


def test_an_axis_without_limits_has_none(fault: Path) -> None:
    recording = read_recording(fault)
    limits = {**recording.info.limits, "joint3": (-math.inf, math.inf, 3.0, 9.0)}
    turning = replace(recording, info=replace(recording.info, limits=limits))
    wheel = replace(recording, info=replace(recording.info, limits={}))
    for base, limited in ((turning, ["velocity"]), (wheel, [])):
        lines = [line.split() for line in explained(base) if line.startswith("  ")]
        assert [line[0] for line in lines if {"limit", "limits"} & {*line}] == limited
