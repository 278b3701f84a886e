"""Kinds of mobile bases, of robotd and of plugins.

A plugin's kind is an entry point of the group ``robotd.bases``, ``NAME = "package.module:Class"``,
that leads to a subclass of ``DriveSettings``; ``drive: {kind: NAME}`` chooses it.
"""

from __future__ import annotations

from functools import cache
from importlib.metadata import EntryPoint
from typing import Annotated, Any

from pydantic import ValidatorFunctionWrapHandler, WrapValidator

from robotd.descriptor.drive_settings import (
    DifferentialDrive,
    DriveSettings,
    MecanumDrive,
    SkidSteerDrive,
    TricycleDrive,
)
from robotd.descriptor.section import validation_error
from robotd.entry_points import entry_points
from robotd.errors import PluginError

GROUP = "robotd.bases"

_BUILT_IN: dict[str, type[DriveSettings]] = {
    "differential": DifferentialDrive,
    "skid_steer": SkidSteerDrive,
    "mecanum": MecanumDrive,
    "tricycle": TricycleDrive,
}


def base_kinds() -> list[str]:
    """Return the names of all kinds, robotd's own first. Any thread."""
    return [*_BUILT_IN, *sorted({*_of_plugins()} - {*_BUILT_IN})]


@cache
def base_kind(name: str) -> type[DriveSettings]:
    """Return the model of a kind that is in ``base_kinds``. Any thread.

    Raises PluginError: the kind of a plugin cannot be used, because its name is taken, it cannot
    be imported, or it is no subclass of ``DriveSettings`` that names its kinematics.
    """
    entries = _of_plugins().get(name, [])
    if len(entries) + (name in _BUILT_IN) > 1:
        others = ", ".join(entry.value for entry in entries)
        raise PluginError(f"kind of base {name!r} exists more than once: {others}")
    if not entries:
        return _BUILT_IN[name]
    [entry] = entries
    try:
        kind = entry.load()
    except (Exception, SystemExit) as error:  # of a third party
        what = f"kind of base {name!r} cannot be imported: {type(error).__name__}: {error}"
        raise PluginError(what) from error
    if not (isinstance(kind, type) and issubclass(kind, DriveSettings) and kind.KINEMATICS):
        raise PluginError(
            f"kind of base {name!r}: {entry.value} is no DriveSettings with KINEMATICS"
        )
    return kind


@cache
def _of_plugins() -> dict[str, list[EntryPoint]]:
    found: dict[str, list[EntryPoint]] = {}
    for entry in entry_points(group=GROUP):
        found.setdefault(entry.name, []).append(entry)
    return found


def _by_kind(value: Any, handler: ValidatorFunctionWrapHandler) -> DriveSettings:
    """Validate by the model that ``kind`` names.

    Unlike those of a tagged union, the keys of errors do not contain the kind.
    """
    del handler
    if isinstance(value, DriveSettings):
        return value
    kind = value.get("kind", "differential") if isinstance(value, dict) else "differential"
    if isinstance(kind, str) and kind in base_kinds():
        return base_kind(kind).model_validate(value)
    what = f"unknown kind of base (available: {', '.join(base_kinds())})"
    raise validation_error("drive", [(("kind",), what, kind)])


Drive = Annotated[
    DifferentialDrive | SkidSteerDrive | MecanumDrive | TricycleDrive, WrapValidator(_by_kind)
]
