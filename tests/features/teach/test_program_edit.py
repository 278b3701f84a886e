"""Edits of a program's text: what they change, and that they keep all the rest."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from pathlib import Path

import pytest

from robotd import DescriptorError, InvalidArgument, NotReady, open_robot
from robotd.api.robots import SteppedClock
from robotd_teach import program_edit as edit
from robotd_teach.program_code import Program
from robotd_teach.program_folder import ProgramFolder
from robotd_teach.program_outline import outline

EXAMPLES = Path(__file__).parents[3] / "examples" / "programs"
JOINTS = {"joint1": 0.5, "joint2": -0.25}
TEXT = """\
# cell 4
speed: 0.5 # of the limits

steps:
  # the light first
  - output: {name: 0.1, on: true}
  # then to the part
  - move: {pose: ready, speed: 0.3} # slowly
  - line:
      by: {z: 0.1} # up
      frame: tool
      speed: 0.2

  - repeat:
      times: 2
      steps:
        - wait: {time_s: 1.0}
        - line: {by: {z: -0.1}}
  - path:
      through: [{by: {x: 0.1}}, {by: {y: 0.1}}]
      blend_m: 0.02
"""


def lines(changed: str) -> list[str]:
    """Lines that differ from ``TEXT``, with their sign."""
    found = difflib.ndiff(TEXT.splitlines(), changed.splitlines())
    return [line for line in found if line[0] in "+-"]


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (
            lambda text: edit.with_number(text, (), "speed", 0.75),
            ["- speed: 0.5 # of the limits", "+ speed: 0.75 # of the limits"],
        ),
        (
            lambda text: edit.with_number(text, ("steps", 1, "move"), "speed", None),
            [
                "-   - move: {pose: ready, speed: 0.3} # slowly",
                "+   - move: {pose: ready} # slowly",
            ],
        ),
        (
            lambda text: edit.with_number(text, ("steps", 2, "line"), "speed", None),
            ["-       speed: 0.2"],
        ),
        (
            lambda text: edit.with_number(text, ("steps", 4, "path"), "speed", 0.4),
            ["+       speed: 0.4"],
        ),
        (
            lambda text: edit.with_number(text, ("steps", 4, "path"), "blend_m", 0.005),
            ["-       blend_m: 0.02", "+       blend_m: 0.005"],
        ),
        (
            lambda text: edit.with_number(
                text, ("steps", 3, "repeat", "steps", 1, "line"), "speed", 0.1
            ),
            ["-         - line: {by: {z: -0.1}}", "+         - line: {by: {z: -0.1}, speed: 0.1}"],
        ),
        (
            lambda text: edit.with_joints(text, ("steps", 2, "line"), JOINTS),
            [
                "-       by: {z: 0.1} # up",
                "-       frame: tool",
                "+       joints: {joint1: 0.5000, joint2: -0.2500} # up",
            ],
        ),
        (
            lambda text: edit.with_move_after(text, ("steps", 4), JOINTS),
            ["+   - move: {joints: {joint1: 0.5000, joint2: -0.2500}}"],
        ),
        (
            lambda text: edit.without_step(text, ("steps", 1)),
            ["-   # then to the part", "-   - move: {pose: ready, speed: 0.3} # slowly"],
        ),
    ],
)
def test_an_edit_changes_its_lines_only(change: Callable[[str], str], expected: list[str]) -> None:
    assert sorted(lines(change(TEXT))) == sorted(expected)


def test_a_step_moves_with_the_comments_above_it() -> None:
    moved = edit.with_step_moved(TEXT, ("steps", 1), -1)
    assert moved.splitlines()[3:8] == [
        "steps:",
        "  # then to the part",
        "  - move: {pose: ready, speed: 0.3} # slowly",
        "  # the light first",
        "  - output: {name: 0.1, on: true}",
    ]
    assert edit.with_step_moved(moved, ("steps", 0), 1) == TEXT


@pytest.mark.parametrize("example", sorted(EXAMPLES.glob("*.yaml")), ids=lambda path: path.stem)
def test_each_step_of_the_examples_can_be_edited(example: Path) -> None:
    text = example.read_text(encoding="utf-8")
    rows = [row for row in outline(Program.read(example)) if row["keys"]]
    assert rows
    comments = [line.split("#", 1)[1] for line in text.splitlines() if "#" in line]
    for row in rows:
        keys, value = row["keys"], (*row["keys"], row["kind"])
        changed = [edit.with_number(text, value, key, 0.25) for key in row["numbers"]]
        changed += [edit.with_step_moved(text, keys, 1)] if row["after"] else []
        changed += [edit.with_joints(text, value, JOINTS)] if row["posed"] else []
        for result in (*changed, edit.with_move_after(text, keys, JOINTS)):
            Program.parse(result)
            kept = [line.split("#", 1)[1] for line in result.splitlines() if "#" in line]
            assert sorted(kept) == sorted(comments)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: edit.with_step_moved(text, ("steps", 0), -1), "steps.0 has no step before"),
        (lambda text: edit.without_step(text, ("steps", 9)), "the program has no steps.9"),
        (
            lambda text: edit.without_step(text, ("steps", 4, "path", "through", 0)),
            "steps.4.path.through is in brackets",
        ),
        (lambda text: edit.with_joints(text, ("steps", 4, "path"), JOINTS), "has no target"),
    ],
)
def test_an_edit_that_is_impossible_says_why(change: Callable[[str], str], message: str) -> None:
    with pytest.raises(InvalidArgument, match=message):
        change(TEXT)


def test_a_program_is_changed_as_it_was_shown_or_not_at_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with open_robot("cr3a", "sim", clock=SteppedClock()) as robot:
        folder = robot.feature(ProgramFolder)
    assert folder.path == tmp_path / "robotd" / "programs" / "cr3a"
    with pytest.raises(InvalidArgument, match="not a valid name of a program"):
        folder.create("../cell", TEXT)
    folder.create("cell", TEXT)
    with pytest.raises(InvalidArgument, match="there is a program 'cell' already"):
        folder.create("cell", TEXT)
    shown = folder.all()["cell"]
    with pytest.raises(DescriptorError, match=r"cell.yaml:2: speed: .*0.01"):
        folder.change("cell", shown, lambda text: edit.with_number(text, (), "speed", 0.0))
    assert folder.read("cell").text == TEXT
    folder.change("cell", shown, lambda text: edit.with_number(text, (), "speed", 0.1))
    with pytest.raises(NotReady, match="was changed since it was shown"):
        folder.change("cell", shown, lambda text: edit.with_number(text, (), "speed", 0.2))
    assert folder.read("cell").file.speed == 0.1


def test_the_segments_of_a_sequence_are_outlined_below_it() -> None:
    text = """\
steps:
  - sequence:
      segments:
        - line: {by: {z: -0.1}}
          blend_m: 0.01
        - arc: {via: {by: {y: 0.1}}, to: {by: {y: 0.2}}, speed: 0.5}
      speed: 0.3
  - message: zurück
"""
    rows = outline(Program.parse(text))
    assert [(row["line"], row["depth"], row["text"]) for row in rows] == [
        (2, 0, "sequence: {speed: 0.3}"),
        (4, 1, "line: {by: {z: -0.1}}, blend_m: 0.01"),
        (6, 1, "arc: {via: {by: {y: 0.1}}, to: {by: {y: 0.2}}, speed: 0.5}"),
        (8, 0, "message: zurück"),
    ]
    assert [row["keys"] for row in rows] == [["steps", 0], [], [], ["steps", 1]]
    assert rows[0]["numbers"] == {"speed": 0.3, "blend_m": None}
    assert "blend_m: 0.02" in edit.with_number(text, ("steps", 0, "sequence"), "blend_m", 0.02)
