"""Installed versions: Python, ROS, robotd, its plugins and features."""

from __future__ import annotations

import platform
import sys
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version

from robotd.api import Finding, MachineContext, RobotdError
from robotd.api.commands import HAS_ROS_WHEELS, import_ros, load_installed, sourced_ros
from robotd.api.features import feature_failures, installed_features
from robotd.api.robots import discover, load_backend

SUPPORTED = ((3, 11), (3, 13))  # of the ROS wheels
EXTRAS = {"page": "aiohttp", "metrics": "prometheus_client", "foxglove": "foxglove-sdk"}


def check_installation(context: MachineContext) -> Iterator[Finding]:
    """Yield the findings about what is installed in this environment."""
    yield Finding("ok", f"robotd {version('robotd')} in {sys.prefix}")
    yield _python()
    yield _ros()
    for reason in (*load_installed().problems(), *feature_failures().values()):
        yield Finding("warning", reason, "update or uninstall it; 'robotd plugins' shows more")
    yield from _backends()
    missing = [name for name, distribution in EXTRAS.items() if not _has(distribution)]
    advice = f"pip install 'robotd[{','.join(missing)}]'" if missing else ""
    features = ", ".join(installed_features())
    without = f"; not installed for: {', '.join(missing)}" if missing else ""
    yield Finding("ok", f"features {features}{without}", advice)


def _python() -> Finding:
    first, last = SUPPORTED
    text = f"Python {platform.python_version()} on {platform.machine()}"
    if HAS_ROS_WHEELS and not first <= sys.version_info[:2] <= last:
        advice = "there are ROS wheels for Python 3.11 to 3.13: make an environment of one of them"
        return Finding("failed", text, advice)
    return Finding("ok", text)


def _ros() -> Finding:
    try:
        import_ros("rclpy")
        import_ros("wmx_ros2_message.srv")
    except RobotdError as error:
        return Finding("failed", str(error))
    return Finding(
        "ok", f"ROS 2 from {'wheels' if HAS_ROS_WHEELS else sourced_ros() or 'the system'}"
    )


def _backends() -> Iterator[Finding]:
    for origin, _ in discover():
        try:
            load_backend(origin.name)
        except RobotdError as error:
            yield Finding("warning", str(error), f"install {origin.distribution} again")
        else:
            yield Finding("ok", f"backend {origin.name} of {origin.distribution} {origin.version}")


def _has(distribution: str) -> bool:
    try:
        version(distribution)
    except PackageNotFoundError:
        return False
    return True
