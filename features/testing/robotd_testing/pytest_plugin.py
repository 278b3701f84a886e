"""pytest plugin of robotd: command-line options only, so that it loads at no cost.

Fixtures and hooks of the conformance checks are in their own ``conftest.py``.
"""

from __future__ import annotations

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options that choose backend and robot."""
    group = parser.getgroup("robotd")
    group.addoption("--robotd-backend", metavar="NAME", help="backend for the conformance checks")
    group.addoption(
        "--robotd-robot",
        metavar="NAME|FILE",
        help="robot that the backend drives; by default two plain joints and a bare axis",
    )
    group.addoption(
        "--robotd-max-excursion",
        metavar="RAD",
        type=float,
        help="end a run on hardware when an axis is so far from its start pose",
    )
    group.addoption(
        "--robotd-set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="replace a value of the robot's file",
    )
    group.addoption(
        "--robotd-range",
        metavar="NAME=LOWER:UPPER",
        action="append",
        default=[],
        help="positions that its surroundings leave an axis, rad or m",
    )
    group.addoption(
        "--robotd-resume",
        metavar="FILE",
        help="note results there, and leave out the checks that have passed in it",
    )
    group.addoption("--robotd-progress", action="store_true", help="print a line for each check")
    group.addoption(
        "--robotd-quick",
        action="store_true",
        help="only the checks that find most faults in 20 s of processor time",
    )
    group.addoption(
        "--robotd-thorough",
        action="store_true",
        help="the long form of the checks whose faults only time reveals",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker of the conformance checks."""
    config.addinivalue_line("markers", "needs(capability): a check of that capability of a backend")
    config.addinivalue_line("markers", "free_space: a check that needs an arm without contacts")
    config.addinivalue_line("markers", "short_period: a check that rare values cannot answer")
    config.addinivalue_line(
        "markers", "clause(id, ...): clauses of the driver contract, by their ids"
    )
