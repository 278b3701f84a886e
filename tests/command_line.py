"""The command line in this process, with everything it prints."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator

import pytest
import structlog
from click.testing import CliRunner, Result

from robotd.cli import main

Robotd = Callable[..., Result]


@pytest.fixture
def robotd() -> Iterator[Robotd]:
    """``robotd("check", "--robot", "cr3a")`` as a shell would call it."""
    before, root = structlog.get_config(), logging.getLogger()
    handlers = [*root.handlers]

    def call(*arguments: str) -> Result:
        return CliRunner().invoke(main, arguments, prog_name="robotd")

    yield call
    structlog.configure(**before)
    root.handlers[:] = handlers  # without the one that takes what libraries log
