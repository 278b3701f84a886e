"""Guards of a robot: what its file asks for is made with the robot, or the robot does not open."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from pkgutil import resolve_name

from robotd.call_timeout import CallTimeout, call_with_timeout
from robotd.descriptor import RobotDescriptor
from robotd.entry_points import owner_of
from robotd.errors import RobotdError, plugin_failure
from robotd.feature import installed_features, requests
from robotd.log import get_logger

GUARD_LIMIT_S = 30.0  # to import and make one

log = get_logger("robot")

Make = Callable[[Callable[..., object]], object]


def requested_guards(descriptor: RobotDescriptor) -> dict[str, str]:
    """Return what makes the guards that a robot's file asks for, by their keys."""
    found: dict[str, str] = {}
    for feature in installed_features().values():
        if feature.guards:
            settings = descriptor.settings(feature.settings)
            found |= {
                key: guard for key, guard in feature.guards.items() if requests(settings, key)
            }
    return found


def make_guards(descriptor: RobotDescriptor, make: Make) -> None:
    """Make what the robot's file asks for, by ``make``, which is ``Robot.feature``.

    Raises DescriptorError: one cannot be made; it names the key.
    """
    for key, target in requested_guards(descriptor).items():
        if reason := _make_guard(target, make):
            raise descriptor.problem(key, f"without this guard the robot does not run: {reason}")


@cache
def warn_unread(path: Path | None, keys: tuple[str, ...]) -> None:
    """Name what a file asks for and this program does not open, once: an observer or a server."""
    if keys:
        log.warning("keys of the robot's file have no effect in this program", keys=keys, file=path)


def _make_guard(target: str, make: Make) -> str:
    """Make a guard; return why it cannot be made, or "". It may be of a third party."""
    found = owner_of(target)
    owner = f" of {found}" if found else ""
    try:
        call_with_timeout(GUARD_LIMIT_S, lambda: make(resolve_name(target)), f"make {target}")
    except KeyboardInterrupt:
        raise
    except RobotdError as error:
        return str(error)
    except CallTimeout:
        return f"{target}{owner} is not done within {GUARD_LIMIT_S:g} s"
    except BaseException as error:  # noqa: BLE001 - SystemExit, too
        return plugin_failure(error, target) + owner
    return ""
