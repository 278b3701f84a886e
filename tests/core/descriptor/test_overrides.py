"""Values of the command line: typed, checked and reported like those of a file."""

from pathlib import Path

import pytest

from robotd.descriptor import RobotDescriptor, load_robot_descriptor, parse_override
from robotd.errors import DescriptorError

ARM = """\
schema: 1
name: arm
joints:
  - {name: a, axis: 0, lower_rad: -1, upper_rad: 1, velocity_rad_s: 2, acceleration_rad_s2: 3}
  - {name: b, axis: 1, lower_rad: -1, upper_rad: 1, velocity_rad_s: 2, acceleration_rad_s2: 3}
default_variant: slow
variants:
  slow: {cycle: {rate_hz: 100}}
"""


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    path = tmp_path / "robot.yaml"
    path.write_text(ARM)
    return path


def load(path: Path, *texts: str, variant: str | None = None) -> RobotDescriptor:
    return load_robot_descriptor(path, variant, overrides=[parse_override(text) for text in texts])


def test_an_override_wins_over_file_and_variant(arm: Path) -> None:
    robot = load(arm, "cycle.rate_hz=250", "joints.1.upper_rad=0.5", "summary=an arm")
    assert (robot.cycle.rate_hz, robot.summary) == (250.0, "an arm")
    assert [joint.upper_rad for joint in robot.joints] == [1.0, 0.5]


def test_missing_sections_are_created_and_values_are_typed(arm: Path) -> None:
    robot = load(arm, "backends.sim.seed=7", "backends.sim.name='7'", "backends.sim.list=[1, 2]")
    assert robot.backends["sim"] == {"seed": 7, "name": "7", "list": [1, 2]}


def test_the_last_of_two_overrides_wins(arm: Path) -> None:
    assert load(arm, "cycle.rate_hz=250", "cycle.rate_hz=125").cycle.rate_hz == 125.0


def test_the_file_itself_is_not_changed(arm: Path) -> None:
    load(arm, "cycle.rate_hz=250")
    assert load(arm).cycle.rate_hz == 100.0


def test_every_variant_is_checked_with_the_override(arm: Path) -> None:
    with pytest.raises(DescriptorError, match=r"^--set: cycle\.rate_hz: must be at most 2000"):
        load(arm, "cycle.rate_hz=5000", variant="slow")


@pytest.mark.parametrize(
    ("texts", "problem"),
    [
        (["cycle.rate_hz=fast"], "--set: cycle.rate_hz: must be a valid number (value 'fast')"),
        (["cycle.rat_hz=1"], "--set: cycle.rat_hz: unknown key; did you mean 'rate_hz'?"),
        (["joints.0.velocity_rad_s=0"], "--set: joints.0.velocity_rad_s: must be greater than 0"),
        (["joints.2.axis=0"], "--set: joints.2.axis: '2' is not an index of a list of 2 items"),
        (["joints.first.axis=0"], "'first' is not an index of a list of 2 items"),
        (["name.x=1"], "--set: name.x: name cannot be set from the command line"),
        (["summary=s", "summary.x=1"], "--set: summary.x: summary is 's', not a section"),
        (["cycle.rate_hz=[1"], "--set: cycle.rate_hz: '[1' is not a value of a descriptor"),
        (["cycle.rate_hz"], "--set: 'cycle.rate_hz' is not KEY=VALUE"),
        (["cycle..rate_hz=1"], "'cycle..rate_hz=1' is not KEY=VALUE"),
    ],
)
def test_what_is_wrong_is_said_with_its_key(arm: Path, texts: list[str], problem: str) -> None:
    with pytest.raises(DescriptorError) as raised:
        load(arm, *texts)
    assert problem in str(raised.value)
