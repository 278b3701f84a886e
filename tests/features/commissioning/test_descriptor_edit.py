"""Changes of a robot's file, and the record of finished steps."""

from __future__ import annotations

from pathlib import Path

import pytest

from robotd.descriptor import load_robot_descriptor
from robotd.errors import DescriptorError
from robotd_canopen import robotd_backend
from robotd_commissioning.findings import Change, DescriptorPart
from robotd_commissioning.session import CommissionRecord, DescriptorEdit

KEYS = robotd_backend().axis_keys
TEXT = """\
schema: 1
name: mine                              # of the third machine
parameters_file: null
joints:
  - {name: a, axis: 0, lower_rad: -1, upper_rad: 1, velocity_rad_s: 1, acceleration_rad_s2: 4}
backends:
  canopen:
    axes:
      # behind the door
      - {axis: 0, node: 1, counts_per_rad: 1000.0}    # replaced in May
variants:
  cell:
    backends:
      canopen:
        axes:
          - {axis: 0, node: 9, counts_per_rad: 1000.0, startup: [{object: '0x6065', value: 7}]}
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "robot.yaml"
    path.write_text(TEXT)
    return path


def edit_of(path: Path, variant: str | None = None) -> DescriptorEdit:
    robot = load_robot_descriptor(path, variant)
    assert KEYS is not None
    return DescriptorEdit(robot, robot.joints[0], "canopen", KEYS)


def test_only_the_changed_lines_differ(path: Path) -> None:
    edit = edit_of(path)
    text = edit.changed(
        [
            Change(DescriptorPart.DRIVE, "polarity", -1),
            Change(DescriptorPart.JOINT, "upper_rad", 0.5),
        ]
    )
    before, after = TEXT.splitlines(), text.splitlines()
    changed = [(old, new) for old, new in zip(before, after, strict=True) if old != new]
    assert [new.split()[-1] for _, new in changed] == ["4}", "May"]
    assert "upper_rad: 0.5" in changed[0][1]
    assert "counts_per_rad: 1000.0, polarity: -1} # replaced in May" in changed[1][1]
    difference = edit.difference(text)
    assert difference.count("\n+ ") == difference.count("\n- ") == 2


def test_startup_objects_are_added_or_replaced(path: Path) -> None:
    change = [Change(DescriptorPart.DRIVE, "0x6065", 500)]
    assert "startup: [{object: '0x6065', value: 500}]" in edit_of(path).changed(change).replace(
        '"', "'"
    ).replace("object: 0x6065", "object: '0x6065'")
    of_variant = edit_of(path, "cell").changed(change)
    assert "node: 9" in of_variant
    assert "value: 500" in of_variant
    assert "value: 7" not in of_variant


def test_a_file_that_fails_its_check_is_not_written(path: Path) -> None:
    edit = edit_of(path)
    text = edit.changed([Change(DescriptorPart.JOINT, "upper_rad", -5.0)])
    with pytest.raises(DescriptorError, match="lower_rad"):
        edit.save(text, load_robot_descriptor)
    assert path.read_text() == TEXT
    edit.save(edit.changed([Change(DescriptorPart.JOINT, "upper_rad", 0.5)]), load_robot_descriptor)
    assert load_robot_descriptor(path).joints[0].upper_rad == 0.5
    assert [file.name for file in path.parent.iterdir()] == ["robot.yaml"]


def test_a_symbolic_link_stays_one(path: Path) -> None:
    file = path.with_name("machines") / "third.yaml"
    file.parent.mkdir()
    path.replace(file)
    path.symlink_to(file)
    record = path.with_name("robot.commission.json")
    record.symlink_to(file.with_name("third.json"))
    edit = edit_of(path)
    edit.save(edit.changed([Change(DescriptorPart.JOINT, "upper_rad", 0.5)]), load_robot_descriptor)
    CommissionRecord(path).note("a", "direction", "right")
    assert path.is_symlink()
    assert record.is_symlink()
    assert load_robot_descriptor(file).joints[0].upper_rad == 0.5
    assert CommissionRecord(path).finding("a", "direction") == "right"
    assert {path.name for path in file.parent.iterdir()} == {"third.yaml", "third.json"}
    assert {file.name for file in path.parent.iterdir()} == {path.name, record.name, "machines"}


def test_lines_keep_their_ends(path: Path) -> None:
    path.write_bytes(TEXT.replace("\n", "\r\n").encode())
    edit = edit_of(path)
    edit.save(edit.changed([Change(DescriptorPart.DRIVE, "polarity", -1)]), load_robot_descriptor)
    written = path.read_bytes()
    assert b"polarity: -1" in written
    assert written.count(b"\r\n") == written.count(b"\n") == TEXT.count("\n")


def test_inherited_axes_cannot_be_written(path: Path) -> None:
    child = path.with_name("child.yaml")
    child.write_text("extends: robot.yaml\nname: child\n")
    with pytest.raises(DescriptorError, match=r"joints: .*in one that it extends: copy the list"):
        edit_of(child)


def test_the_record_survives_and_can_be_forgotten(path: Path) -> None:
    CommissionRecord(path).note("a", "direction", "right")
    record = CommissionRecord(path)
    assert record.finding("a", "direction") == "right"
    assert record.finding("a", "scaling") is record.finding("b", "direction") is None
    record.forget("a")
    assert CommissionRecord(path).finding("a", "direction") is None


def test_a_file_that_is_no_record_is_named(path: Path) -> None:
    path.with_name("robot.commission.json").write_text("[]")
    with pytest.raises(DescriptorError, match="not a record of a commissioning"):
        CommissionRecord(path)
