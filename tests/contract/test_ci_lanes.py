"""``.ci/run`` runs every command, names those that failed, and fails with them."""

from __future__ import annotations

import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[2]
LANES = """
set -euo pipefail
. .ci/lanes.sh
first() {{ check echo first; check {first}; check echo first went on; }}
second() {{ check echo second; check {second}; check echo second went on; }}
side_by_side first second
report
"""


def run(first: str = "true", second: str = "true") -> tuple[int, str]:
    script = LANES.format(first=first, second=second)
    done = subprocess.run(
        ["bash", "-c", script],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout


def test_what_has_not_failed_passes() -> None:
    status, output = run()
    assert status == 0
    assert "0 commands failed" in output


def test_a_command_that_fails_in_either_lane_is_named_and_the_others_run() -> None:
    for lanes in (("false a", "true"), ("true", "false a"), ("false a", "false a")):
        status, output = run(*lanes)
        assert status == 1
        assert f"{lanes.count('false a')} commands failed" in output
        assert output.endswith("false a\n")
        assert "first went on" in output
        assert "second went on" in output


def test_the_time_of_each_command_is_printed() -> None:
    assert "== true: 0.0" in run()[1]
