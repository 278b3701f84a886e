"""The pytest plugin of robotd: options only, so that it costs other test suites nothing.

Fixtures and hooks of the conformance checks are in their own ``conftest.py``.
"""

from __future__ import annotations

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    """Which backend, and which robot on it."""
    group = parser.getgroup("robotd")
    group.addoption("--robotd-backend", metavar="NAME", help="backend for the conformance checks")
    group.addoption(
        "--robotd-robot",
        metavar="NAME|FILE",
        help="robot that the backend drives; by default two plain joints and a bare axis",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Marks are known whatever the settings of pytest say."""
    config.addinivalue_line("markers", "needs(capability): a check of that capability of a backend")
