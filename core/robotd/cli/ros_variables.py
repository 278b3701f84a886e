"""Environment variables that ROS reads at its start: checked before it does.

With a wrong one rcl ends the process or answers with texts of the middleware.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from pathlib import Path

MAX_DOMAIN = 232  # the highest whose ports there are: 7400 + 250 · 232 = 65400
DEFAULT_MIDDLEWARE = "rmw_fastrtps_cpp"
_INDEX = "share/ament_index/resource_index/rmw_typesupport"
_LOADER = "rmw_implementation"  # loads one of the others


def domain_problem(variables: Mapping[str, str] = os.environ) -> str:
    """Return what is wrong with ``ROS_DOMAIN_ID``; "" for nothing."""
    domain = variables.get("ROS_DOMAIN_ID") or "0"
    if domain.isascii() and domain.isdecimal() and int(domain) <= MAX_DOMAIN:
        return ""
    return f"ROS_DOMAIN_ID is {domain!r}, must be a whole number from 0 to {MAX_DOMAIN}"


def middleware_problem(variables: Mapping[str, str] = os.environ) -> str:
    """Return what is wrong with ``RMW_IMPLEMENTATION``; "" for nothing, and where it is unknown."""
    wanted, installed = variables.get("RMW_IMPLEMENTATION"), installed_middlewares(variables)
    if not wanted or not installed or wanted in installed:
        return ""
    return (
        f"RMW_IMPLEMENTATION is {wanted!r}, which is not installed here (installed:"
        f" {', '.join(sorted(installed))})"
    )


def installed_middlewares(variables: Mapping[str, str] = os.environ) -> set[str]:
    """Return the names of the middlewares of the ROS in use; empty where they are not known."""
    prefixes = [sys.prefix, *variables.get("AMENT_PREFIX_PATH", "").split(os.pathsep)]
    indices = (Path(prefix, _INDEX) for prefix in prefixes if prefix)
    found = (path.name for index in indices if index.is_dir() for path in index.iterdir())
    return {*found} - {_LOADER}
