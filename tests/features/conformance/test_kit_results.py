"""A run of the conformance checks that was stopped goes on from its file of results."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from robotd.errors import InvalidArgument
from robotd_conformance.checks.results import Results
from robotd_conformance.conform_command import conform

SIM = ("sim", "cr3a")
CHECKS = [SimpleNamespace(nodeid=f"kit/test_units.py::test_{name}") for name in "abc"]


def left(results: Results) -> list[str]:
    return [item.nodeid[-1] for item in results.split(CHECKS)[0]]  # type: ignore[arg-type]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Results of a run that was stopped while check c ran."""
    path = tmp_path / "build" / "results.jsonl"
    results = Results(path, SIM)
    results.note(CHECKS[0].nodeid, "passed", 0.5)
    results.note(CHECKS[1].nodeid, "failed", 0.5)
    with path.open("a", encoding="utf-8") as file:
        file.write('{"check": "test_un')
    return path


def test_what_has_passed_is_left_out(path: Path) -> None:
    assert left(Results(path, SIM)) == ["b", "c"]


def test_another_robot_begins_anew(path: Path) -> None:
    assert left(Results(path, ("sim", "cr5a"))) == ["a", "b", "c"]
    assert left(Results(path, SIM)) == ["a", "b", "c"]


def test_a_complete_run_begins_anew(path: Path) -> None:
    Results(path, SIM).complete()
    assert left(Results(path, SIM)) == ["a", "b", "c"]


def test_a_file_of_results_that_cannot_be_written_ends_the_run_at_its_start(
    tmp_path: Path,
) -> None:
    (tmp_path / "file").touch()
    junit = tmp_path / "file" / "results.xml"
    with pytest.raises(InvalidArgument, match=f"--junit: .*{junit.parent}: File exists"):
        CliRunner().invoke(
            conform, ["--backend", "sim", "--junit", str(junit)], catch_exceptions=False
        )
