from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from robotd.cli import main
from robotd_service.service_command import environment_text, quoted

CANOPEN = (
    *("--robot", "cr3a", "--backend", "canopen"),
    *("--set", "backends.canopen.bus.channel=can0"),
)
ETHERCAT = ("--robot", "cr3a", "--backend", "ethercat", "--variant", "ethercat_simulated")
MAX_EXPOSURE = 35  # tenths, of systemd-analyze security
analyze = shutil.which("systemd-analyze")


def install(*words: str) -> Result:
    return CliRunner().invoke(main, ["service", "install", *words], prog_name="robotd")


def unit_of(root: Path, *words: str) -> Path:
    result = install(*words, "--root", str(root))
    assert result.exit_code == 0, result.output
    [unit] = (root / "etc/systemd/system").iterdir()
    return unit


def value(unit: Path, key: str) -> str:
    [line] = [line for line in unit.read_text().splitlines() if line.startswith(f"{key}=")]
    return line.partition("=")[2]


def test_the_unit_starts_the_robot_with_its_servos_off(tmp_path: Path) -> None:
    unit = unit_of(tmp_path, *CANOPEN, "--namespace", "left", "--health", "8091")
    assert unit.name == "robotd-cr3a.service"
    command = value(unit, "ExecStart")
    assert command.startswith(f"{sys.executable} -m robotd run --robot cr3a --backend canopen ")
    assert "--set backends.canopen.bus.channel=can0" in command
    assert "--set engine.enable_at_start=false --health 8091 --log-format json" in command
    assert command.endswith("$ROBOTD_ARGS --ros-args -r __ns:=/left")
    assert value(unit, "Type") == "notify"
    assert value(unit, "User") == "robotd"
    assert value(unit, "CapabilityBoundingSet") == ""
    assert value(unit, "LimitRTPRIO") == "60"


@pytest.mark.parametrize("namespace", ["left/arm_2", "/left/arm_2/", "/"])
def test_a_namespace_may_be_nested(tmp_path: Path, namespace: str) -> None:
    unit = unit_of(tmp_path, *CANOPEN, "--namespace", namespace)
    ending = f" -r __ns:=/{namespace.strip('/')}"
    assert value(unit, "ExecStart").endswith(ending)


def test_a_backend_says_which_capabilities_it_needs(tmp_path: Path) -> None:
    unit = unit_of(tmp_path, *ETHERCAT)
    assert value(unit, "CapabilityBoundingSet") == "CAP_NET_RAW"
    assert value(unit, "AmbientCapabilities") == "CAP_NET_RAW"


def test_an_environment_that_was_edited_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "17")
    monkeypatch.setenv("ROS_ARGS", "no variable of ROS")
    unit_of(tmp_path, *CANOPEN)
    environment = tmp_path / "etc/robotd/cr3a.env"
    assert 'ROS_DOMAIN_ID="17"' in environment.read_text()
    assert "ROS_ARGS=" not in environment.read_text()
    assert (tmp_path / "etc/robotd/cr3a.d").is_dir()
    environment.write_text("edited")
    unit_of(tmp_path, *CANOPEN)
    assert environment.read_text() == "edited"


def test_a_robot_or_backend_that_is_wrong_writes_nothing(tmp_path: Path) -> None:
    for words, text in (
        (("--robot", "cr3b"), "cr3b"),
        (("--robot", "cr3a", "--backend", "none"), "none"),
        (("--robot", "cr3a", "--backend", "canopen"), "name the CAN bus"),
        ((*CANOPEN, "--name", "../up"), "--name"),
        ((*CANOPEN, "--namespace", "a b"), "--namespace 'a b'"),
        ((*CANOPEN, "--namespace", "left//arm"), "--namespace 'left//arm'"),
        ((*CANOPEN, "--namespace", "left/2"), "--namespace 'left/2'"),
        ((*CANOPEN, "--user", "a b"), "--user 'a b'"),
        ((*CANOPEN, "--user", "robotd\nGroup=root"), "--user"),
    ):
        result = install(*words, "--root", str(tmp_path))
        assert result.exit_code != 0
        assert text in result.output
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("word", "expected"),
    [
        ("cr3a", "cr3a"),
        ("/srv/my robot.yaml", '"/srv/my robot.yaml"'),
        ("100%", '"100%%"'),
        ("$HOME", '"$$HOME"'),
        ('a"b\\c', '"a\\"b\\\\c"'),
        ("a\nb", '"a\\nb"'),
        ("", '""'),
    ],
)
def test_words_reach_the_command_as_they_are(word: str, expected: str) -> None:
    assert quoted(word) == expected


def test_values_of_the_environment_are_quoted() -> None:
    assert 'ROS_STATIC_PEERS="a;b \\"c\\""' in environment_text([("ROS_STATIC_PEERS", 'a;b "c"')])


@pytest.mark.skipif(analyze is None, reason="systemd-analyze is not installed")
@pytest.mark.parametrize(
    "words", [CANOPEN, ETHERCAT, (*CANOPEN, "--user", "root")], ids=("canopen", "ethercat", "root")
)
def test_systemd_accepts_the_unit(tmp_path: Path, words: tuple[str, ...]) -> None:
    unit = unit_of(tmp_path, *words)
    found = subprocess.run(
        [str(analyze), "verify", "--man=no", unit], capture_output=True, text=True, check=False
    )
    named = [line for line in found.stderr.splitlines() if unit.name in line]
    assert (found.returncode, named) == (0, []), found.stderr


@pytest.mark.skipif(analyze is None, reason="systemd-analyze is not installed")
def test_the_unit_is_little_exposed(tmp_path: Path) -> None:
    unit = unit_of(tmp_path, *ETHERCAT)
    found = subprocess.run(
        [
            *(str(analyze), "security", "--offline=true", "--json=short", "--no-pager"),
            *(f"--threshold={MAX_EXPOSURE}", unit),
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    exposed = [
        check["name"] for check in json.loads(found.stdout) if float(check["exposure"] or 0) > 0.2
    ]
    assert found.returncode == 0, exposed
