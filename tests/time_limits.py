"""Time limit of each test: a plugin of pytest that lets one test fail and never the session."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from pytest_timeout import _get_item_settings


class TimeLimits:
    """Limit set-up and end of a test, as pytest-timeout does the test itself.

    With ``timeout_func_only`` pytest-timeout watches the test alone. Without it one timer runs over
    the whole protocol; where it expires between two phases, pytest ends with INTERNALERROR.
    """

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> Iterator[None]:
        with _limited(item):
            return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_teardown(self, item: pytest.Item) -> Iterator[None]:
        with _limited(item):
            return (yield)


@contextmanager
def _limited(item: pytest.Item) -> Iterator[None]:
    limits = _get_item_settings(item)
    if not limits.timeout:
        yield
        return
    item.ihook.pytest_timeout_set_timer(item=item, settings=limits)
    try:
        yield
    finally:
        item.ihook.pytest_timeout_cancel_timer(item=item)
