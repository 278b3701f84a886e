"""Drives that go on by themselves when the connection is lost are named before anything moves."""

from __future__ import annotations

from typing import Any

import pytest
from click.testing import CliRunner
from structlog.testing import capture_logs
from tests.plugins.independent.conftest import OpenBench

from robotd.cli import main

TEXT = "joint1 (node 5) need not stop by itself when robotd or the cable is lost"


@pytest.mark.parametrize(
    ("knobs", "axis", "reason"),
    [
        ({"absent": (0x6007,)}, {}, "0x6007 is missing or read-only"),
        ({"rejected": (0x1016,)}, {}, "0x1016 is missing or read-only"),
        ({}, {"skip_writes": ["0x1016"]}, "0x1016 is not written (skip_writes)"),
    ],
)
def test_the_check_names_them(
    open_bench: OpenBench, knobs: dict[str, Any], axis: dict[str, Any], reason: str
) -> None:
    with open_bench(axis=axis, **knobs) as bench:
        assert list(bench.robot.cautions) == [f"{TEXT}: {reason}"]
        done = CliRunner().invoke(main, ["check", "--robot", str(bench.robot.descriptor.path)])
        assert f"{TEXT}: {reason}" in " ".join(done.output.split())


@pytest.mark.parametrize(
    ("knobs", "reason"),
    [
        ({"rejected": (0x1016,), "rejection": "abort"}, "abort 0x08000022"),
        ({"absent": (0x6007,)}, "it has no object 0x6007"),
    ],
)
def test_the_start_names_them(
    open_bench: OpenBench,
    knobs: dict[str, Any],
    reason: str,
) -> None:
    with open_bench(**knobs) as bench:
        with capture_logs() as lines:
            bench.robot.start()
        [caution] = bench.robot.cautions
        assert caution.startswith(TEXT)
        assert reason in caution
        assert caution in [line.get("reason") for line in lines if line["event"] == "caution"]


def test_a_drive_that_stops_by_a_value_of_its_own_is_none(open_bench: OpenBench) -> None:
    """Its 0x6007 is read-only, and 1."""
    with open_bench(rejected=(0x6007,)) as bench:
        bench.robot.start()
        assert not bench.robot.cautions


def test_a_drive_with_both_objects_is_none(open_bench: OpenBench) -> None:
    with open_bench() as bench:
        assert not bench.robot.cautions
        bench.robot.start()
        assert not bench.robot.cautions
