"""Open files of a served robot: enough for a recording beside full ports."""

from __future__ import annotations

import subprocess
import sys

import pytest

from robotd.open_files import MAX_OPEN_FILES

REPORT = (
    "import resource; from robotd.open_files import reserve_files;"
    "resource.setrlimit(resource.RLIMIT_NOFILE, ({soft}, {hard})); reserve_files();"
    "print('limit', resource.getrlimit(resource.RLIMIT_NOFILE)[0])"
)


@pytest.mark.parametrize(
    ("soft", "hard", "allowed"),
    [(128, 1024, MAX_OPEN_FILES), (128, 256, 256), (1024, 1024, 1024)],
    ids=["raised", "as far as allowed", "kept"],
)
def test_the_limit_of_open_files_suffices_for_full_ports(
    soft: int, hard: int, allowed: int
) -> None:
    code = REPORT.format(soft=soft, hard=hard)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert f"limit {allowed}" in done.stdout
    assert ("few open files are allowed" in done.stdout + done.stderr) is (allowed < MAX_OPEN_FILES)
