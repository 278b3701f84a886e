"""``.ci/run`` repeats what failed once, names it, and fails when there is too much of it."""

from __future__ import annotations

import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[2]
LANE = """
set -euo pipefail
. .ci/lanes.sh
stolen_percent() {{ echo {stolen}; }}
trap 'rm -rf "$RECORDS"' EXIT
lane() {{
  if [ $# = 0 ]; then
    for number in {failures}; do echo "FAILED tests/x.py::test_$number - AssertionError"; done
    return 1
  fi
  echo "second run: $*"
  return {second}
}}
first() {{ attempt lane --last-failed; }}
other() {{ echo other; {other}; }}
side_by_side first other
echo both ended
repeat_failed
report_repeated
"""


def run(failures: str, second: int = 0, other: str = "true", stolen: int = 0) -> tuple[int, str]:
    script = LANE.format(failures=failures, second=second, other=other, stolen=stolen)
    done = subprocess.run(
        ["bash", "-c", script], cwd=ROOT, capture_output=True, text=True, check=False
    )
    return done.returncode, done.stdout + done.stderr


def test_a_repeated_test_is_named() -> None:
    status, output = run("1")
    assert status == 0
    assert "second run: --last-failed" in output
    assert "1 tests needed a second run" in output
    assert "  lane: tests/x.py::test_1\n" in output


def test_more_than_three_repeated_tests_fail() -> None:
    assert run("1 2 3")[0] == 0
    status, output = run("1 2 3 4")
    assert status != 0
    assert "lane: tests/x.py::test_4" in output


def test_more_are_repeated_where_the_host_takes_processor_time() -> None:
    failures = " ".join(map(str, range(12)))
    status, output = run(failures, stolen=30)
    assert status == 0
    assert "at most 12; the host took 30 % of the processor time" in output
    assert run(failures + " 12", stolen=30)[0] != 0
    assert run(failures, stolen=4)[0] != 0


def test_a_second_failure_fails() -> None:
    assert run("1", second=1)[0] == 1


def test_a_failure_without_a_named_test_counts() -> None:
    status, output = run("")
    assert status == 0
    assert "lane: ended without naming a failed test" in output


def test_second_runs_wait_until_the_lanes_have_ended() -> None:
    output = run("1")[1]
    assert output.index("both ended") < output.index("second run")


def test_an_error_in_either_lane_fails() -> None:
    status, output = run("1", other="false; echo went on")
    assert status != 0
    assert "other" in output
    assert "went on" not in output
    assert "both ended" not in output
