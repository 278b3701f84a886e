"""pytest fixtures with whole robots: ``pytest_plugins = ["robotd_testing.robots"]``.

``robotd_robot("cr3a")`` starts one in the test's process, in a ROS domain of its own. What robotd
logs is shown with a test that fails.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import pytest
import structlog

from robotd.api.robots import configure_logging
from robotd_testing.domain import own_domain

if TYPE_CHECKING:
    from robotd_testing.served_robot import RobotUnderTest

_LOG = pytest.StashKey[io.StringIO]()


@pytest.fixture
def robotd_log(request: pytest.FixtureRequest) -> Iterator[Callable[[], str]]:
    """Function that returns robotd's log of this test; shown when the test fails."""
    stream, before = io.StringIO(), structlog.get_config()
    request.node.stash[_LOG] = stream
    configure_logging("info", stream=stream)
    yield stream.getvalue
    structlog.configure(**before)


@pytest.fixture
def robotd_domain(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """ROS domain reserved for this test, also set in the environment."""
    with own_domain() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        yield domain


@pytest.fixture
def robotd_robot(
    robotd_log: Callable[[], str], robotd_domain: int
) -> Iterator[Callable[..., RobotUnderTest]]:
    """Function that starts a robot: ``robotd_robot("cr3a", time_scale=5.0)``.

    The arguments are those of ``robotd_testing.served_robot.robot_under_test``.
    """
    with warnings.catch_warnings():
        # The first message to be used imports an old lark, which imports deprecated modules.
        warnings.simplefilter("ignore", DeprecationWarning)
        from robotd_testing.served_robot import robot_under_test

    with ExitStack() as robots:

        def start(name: Any, **options: Any) -> RobotUnderTest:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", DeprecationWarning)
                made = robot_under_test(name, robotd_domain, **options)
                return robots.enter_context(made)

        yield start


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item,
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Add the log to the report of a test that failed."""
    report = yield
    stream = item.stash.get(_LOG, None)
    if report.failed and stream is not None:
        report.sections.append(("robotd's log", stream.getvalue()))
    return report
