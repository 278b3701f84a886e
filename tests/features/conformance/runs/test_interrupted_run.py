"""``robotd conform`` that is asked to end leaves nothing that moves."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from tests.ros.robot_process import WAIT_S, wait_until

from robotd.cli.exit_codes import ExitCode

CONFORM = (sys.executable, "-m", "robotd", "conform", "--backend", "sim")
SHOW_LOG = ("-o", "log_cli=true", "-o", "log_cli_level=INFO")


@pytest.mark.parametrize(
    ("number", "to_group"),
    [
        (signal.SIGTERM, False),
        (signal.SIGHUP, True),
        (signal.SIGQUIT, True),
        (signal.SIGINT, True),
    ],
)
def test_a_signal_ends_the_checks_in_order(number: int, to_group: bool, tmp_path: Path) -> None:
    """A terminal signals its process group, a supervisor the command alone."""
    output, junit = tmp_path / "output", tmp_path / "results.xml"
    with (
        output.open("w") as log,
        subprocess.Popen(
            [*CONFORM, "--junit", str(junit), "--", *SHOW_LOG],
            stdout=log,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        ) as process,
    ):
        wait_until(lambda: "communication started" in output.read_text(), "the first check")
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        if to_group:
            os.killpg(process.pid, number)
        else:
            process.send_signal(number)
        assert process.wait(WAIT_S) == ExitCode.INTERRUPTED
    assert children
    assert not any(Path("/proc", child).exists() for child in children)
    *_, last = (line for line in output.read_text().splitlines() if "device " in line)
    assert "device closed" in last
    text = output.read_text()
    assert "verdict: none, the run was interrupted" in text
    tested = re.search(r"checks: (\d+) of (\d+)\n(\d+) checks were not executed", text)
    assert tested, "the report counts the checks that are missing"
    done, total, absent = map(int, tested.groups())
    assert done <= total - absent < total
    suite = ET.parse(junit).getroot()[0]
    assert suite.get("errors") == "1"
    assert f"of {total} checks were executed" in junit.read_text()
