"""Files on disk: each test writes the robots that it needs."""

import contextlib
import re
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import BaseModel, ConfigDict, Field

from robotd.descriptor import (
    RobotDescriptor,
    list_robots,
    load_robot_descriptor,
    validate_section,
)
from robotd.errors import DescriptorError

ARM = """\
schema: 1
name: arm
summary: two joints
joints:
  - {name: a, axis: 0, lower_rad: -1, upper_rad: 1, velocity_rad_s: 2, acceleration_rad_s2: 3}
  - {name: b, axis: 3, lower_rad: -1, upper_rad: 1, velocity_rad_s: 2, acceleration_rad_s2: 3}
gripper: {output_byte: 0, output_bit: 0, joints: [f], open_m: 0.0, closed_m: 0.1}
nodes: [manipulator_state]
ros_parameters:
  manipulator_state: {topic: /a, rate: 500}
backends:
  sim:
    noise_rad: 0.5
default_variant: one
variants:
  one: {cycle: {rate_hz: 100}}
  two: {gripper: null, ros_parameters: {manipulator_state: {topic: null, extra: [1.5, 2.0]}}}
"""


class SimOptions(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")

    noise_rad: float = Field(0.0, le=0.1)


@pytest.fixture
def robots(tmp_path: Path) -> Path:
    write(tmp_path, "arm", ARM)
    return tmp_path


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / name / "robot.yaml"
    path.parent.mkdir(exist_ok=True)
    path.write_text(text)
    return path


def rejection(folder: Path, text: str) -> list[str]:
    """The lines of the error that a file with ``text`` gives, without the file's path."""
    path = write(folder, "wrong", text)
    with pytest.raises(DescriptorError) as caught:
        load_robot_descriptor(path)
    return [line.removeprefix(f"{path}:") for line in str(caught.value).splitlines()]


def test_a_robot_by_name_folder_or_file(robots: Path) -> None:
    by_name = load_robot_descriptor("arm", search_path=[robots])
    assert by_name.joint_names == ("a", "b")
    assert by_name.axes == 4, "the highest axis of a joint, plus 1"
    assert by_name.path == robots / "arm" / "robot.yaml"
    assert load_robot_descriptor(robots / "arm") == by_name
    assert load_robot_descriptor(str(robots / "arm" / "robot.yaml")) == by_name


def test_variants(robots: Path) -> None:
    one = load_robot_descriptor("arm", search_path=[robots])
    two = load_robot_descriptor("arm", "two", [robots])
    assert (one.variant, one.cycle.rate_hz) == ("one", 100)
    assert (two.variant, two.cycle.rate_hz, two.gripper) == ("two", 500, None)
    assert two.ros_parameters["manipulator_state"] == {"rate": 500, "extra": [1.5, 2.0]}


def test_unknown_names_list_what_there_is(robots: Path) -> None:
    with pytest.raises(DescriptorError, match=r"unknown robot 'amr'; did you mean 'arm'\?"):
        load_robot_descriptor("amr", search_path=[robots])
    with pytest.raises(
        DescriptorError, match=r"'tow'; did you mean 'two'\? \(available: one, two\)"
    ):
        load_robot_descriptor("arm", "tow", [robots])
    with pytest.raises(DescriptorError, match="cannot be read: No such file"):
        load_robot_descriptor(robots / "nothing.yaml")


def test_a_folder_in_place_of_a_name_is_answered_with_its_file(
    robots: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(robots)
    with pytest.raises(DescriptorError, match=r"unknown robot 'arm' .*: arm/robot.yaml$"):
        load_robot_descriptor("arm", search_path=[])


def test_one_name_in_two_folders_is_rejected(robots: Path, tmp_path: Path) -> None:
    write(tmp_path / "arm", "arm", ARM)
    with pytest.raises(DescriptorError, match="'arm' exists twice: "):
        load_robot_descriptor("arm", search_path=[robots, tmp_path / "arm"])


def test_all_problems_come_at_once_with_line_key_and_value(robots: Path) -> None:
    text = ARM.replace("velocity_rad_s: 2", "velcity_rad_s: 2", 1)
    text = text.replace("axis: 3", "axis: 128").replace("schema: 1", "schema: 2")
    assert rejection(robots, text) == [
        "1: schema: must be 1 (value 2)",
        "5: joints.0.velocity_rad_s: missing",
        "5: joints.0.velcity_rad_s: unknown key; did you mean 'velocity_rad_s'?",
        "6: joints.1.axis: must be less than 128 (value 128)",
    ]


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("axis: 3", "axis: 0", "6: joints.1.axis: used before, by joints.0 (value 0)"),
        ("name: b", "name: a", "6: joints.1.name: used before, by joints.0 (value 'a')"),
        ("lower_rad: -1", "lower_rad: 1", "must be less than upper_rad (1.0) (value 1.0)"),
        ("axis: 0", "axis: '0'", "5: joints.0.axis: must be a valid integer (value '0')"),
        ("_rad: -1", "_rad: -.inf", "5: joints.0.lower_rad: must be a finite number (value -inf)"),
        ("joints: [f]", "joints: [a]", "7: gripper.joints.0: is a joint of the arm already"),
        ("joints: [f]", "joints: [f, f]", "7: gripper.joints.1: used before, by joints.0"),
        ("closed_m: 0.1", "closed_m: 0.0", "7: gripper.closed_m: must differ from open_m"),
        ("rate_hz: 100", "rate_hz: 100, 5", "cycle.5: unknown key; a number has a decimal point"),
        ("name: arm", "name: 'an arm'", "2: name: must begin with a letter"),
        ("[manipulator_state]", "[other]", "not in nodes (other) (value 'manipulator_state')"),
        ("rate: 500", "rate: null", "ros_parameters.manipulator_state.rate: must be a boolean"),
        ("rate: 500", "rate: [1, 0.5]", "10: ros_parameters.manipulator_state.rate: must be a li"),
        ("default_variant: one", "default_variant: x", "unknown variant (available: one, two)"),
        ("rate_hz: 100", "rate_hz: 5", "16: cycle.rate_hz: must be at least 10 (value 5)"),
        ("two: {", "two: {name: x, ", "17: variants.two.name: a variant cannot change this"),
        ("topic: null", "topik: null", "17: ros_parameters.manipulator_state.topik: must be a bo"),
        ("gripper: null", "griper: null", "17: griper: unknown key; did you mean 'gripper'?"),
        ("schema: 1", "schema: 1\nurdf: x.urdf", "2: urdf: file"),
        ("schema: 1", "schema: 1\ngroups: [a]", "2: groups: must be a mapping of keys to values"),
        ("schema: 1", "schema: 1\nengine: 1", "2: engine: must be a mapping of keys to values"),
        ("joints: [f]", "joints: f", "7: gripper.joints: must be a list (value 'f')"),
        ("schema: 1", "schema: 1\naxes: 2", "must be less than axes (2) (value 3)"),
    ],
)
def test_refusals(robots: Path, old: str, new: str, expected: str) -> None:
    assert expected in "\n".join(rejection(robots, ARM.replace(old, new, 1)))


def test_variants_are_counted_before_they_are_checked(robots: Path) -> None:
    variants = "".join(f"  v{number}: {{}}\n" for number in range(40))
    found = rejection(robots, ARM.replace("  one: ", f"{variants}  one: "))
    assert found == ["15: variants: 42 variants, the limit is 32"]


def test_of_a_flood_of_mistakes_the_first_are_told(robots: Path) -> None:
    found = rejection(robots, ARM + "".join(f"key{number}: 1\n" for number in range(5000)))
    assert found[0] == "18: key0: unknown key"
    assert len(found) == 51
    assert re.fullmatch(r"and \d+ more problems", found[-1])


def test_a_robot_without_joints_must_say_how_many_axes(robots: Path) -> None:
    assert "axes: missing" in rejection(robots, "schema: 1\nname: bare\n")[0]
    bare = write(robots, "bare", "schema: 1\nname: bare\naxes: 2\n")
    assert load_robot_descriptor(bare).axes == 2


def test_a_file_that_extends_another(robots: Path) -> None:
    (robots / "arm" / "arm.urdf").write_text("<robot/>")
    write(robots, "arm", ARM + "urdf: arm.urdf\n")
    path = write(robots, "cell", "extends: ../arm/robot.yaml\nname: cell\ncycle: {rate_hz: 5}\n")
    with pytest.raises(DescriptorError, match=rf"{path}:3: cycle.rate_hz.*value 5") as caught:
        load_robot_descriptor(path, "two")
    assert caught.value.path == path
    path.write_text("extends: ../arm/robot.yaml\nname: cell\n")
    cell = load_robot_descriptor(path)
    assert (cell.name, cell.path, cell.urdf) == ("cell", path, robots / "arm" / "arm.urdf")


def test_files_that_extend_each_other_are_rejected(robots: Path) -> None:
    write(robots, "x", "extends: ../y/robot.yaml\n")
    write(robots, "y", "extends: ../x/robot.yaml\n")
    with pytest.raises(DescriptorError, match="extends itself"):
        load_robot_descriptor("x", search_path=[robots])


def test_list_robots_keeps_broken_ones_with_their_reason(robots: Path) -> None:
    write(robots, "broken", "schema: 1\nname: broken\naxis: 1\n")
    arm, broken = list_robots([robots])
    assert (arm.name, arm.summary, arm.variants) == ("arm", "two joints", ("one", "two"))
    assert arm.problem is None
    assert "robot.yaml:3: axis: unknown key; did you mean 'axes'?" in (broken.problem or "")


def test_a_section_of_a_plugin(robots: Path) -> None:
    arm = load_robot_descriptor("arm", search_path=[robots])
    line = "robot.yaml:13: backends.sim.noise_rad: must be at most 0.1 (value 0.5)"
    with pytest.raises(DescriptorError, match=re.escape(line)):
        validate_section(arm, "backends.sim", SimOptions)
    assert validate_section(arm, "backends.other", SimOptions) == SimOptions()


def test_a_descriptor_made_in_python_has_no_file() -> None:
    robot = RobotDescriptor.model_validate({"schema": 1, "name": "x", "axes": 1})
    assert (robot.path, robot.variant) == (None, None)
    robot = robot.model_copy(update={"backends": {"sim": {"noise_rad": 1.0}}})
    with pytest.raises(DescriptorError, match=r"^backends\.sim\.noise_rad: must be at most"):
        validate_section(robot, "backends.sim", SimOptions)


WORDS = [*RobotDescriptor.model_fields, "schema", "extends", "rate_hz", "name", "axis", "one"]
VALUES = st.recursive(
    st.one_of(st.sampled_from(WORDS), st.sampled_from(["0", "-1", "1e9", "null", "true", "''"])),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3).map(lambda items: f"[{', '.join(items)}]"),
        st.dictionaries(st.sampled_from(WORDS), inner, max_size=3).map(
            lambda items: "{" + ", ".join(f"{key}: {value}" for key, value in items.items()) + "}"
        ),
    ),
    max_leaves=8,
)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.dictionaries(st.sampled_from(WORDS), VALUES, max_size=6))
def test_no_content_crashes_the_loader(tmp_path: Path, content: dict[str, str]) -> None:
    text = "".join(f"{key}: {value}\n" for key, value in content.items())
    path = write(tmp_path, "fuzz", text)
    with contextlib.suppress(DescriptorError):
        assert load_robot_descriptor(path).name


def test_robots_that_extend_one_of_the_search_path_are_listed(robots: Path) -> None:
    write(robots, "cell", "extends: arm\nname: cell\nsummary: a cell\n")
    summaries = {robot.name: (robot.summary, robot.problem) for robot in list_robots([robots])}
    assert summaries["cell"] == ("a cell", None)


@pytest.mark.parametrize("name", ["press.urdf", "cell/press.urdf", Path("press.xacro")])
def test_a_urdf_in_the_place_of_a_robot_is_rejected_with_the_command_that_reads_it(
    name: str | Path,
) -> None:
    with pytest.raises(DescriptorError, match=f"robotd new-robot NAME --urdf {name}"):
        load_robot_descriptor(name)
