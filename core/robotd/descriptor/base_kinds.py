"""Kinds of mobile bases, by entry points of the group ``robotd.bases``.

``NAME = "package.module:Class"`` leads to a subclass of ``DriveSettings``; ``drive: {kind: NAME}``
chooses it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from importlib.metadata import EntryPoint
from typing import Annotated, Any

from pydantic import GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from robotd.descriptor.drive_settings import DriveSettings
from robotd.descriptor.section import validation_error
from robotd.entry_points import entry_points
from robotd.errors import PluginError

GROUP = "robotd.bases"
DEFAULT = "differential"  # of a section without ``kind``


def base_kinds() -> list[str]:
    """Return the names of all kinds, sorted. Any thread."""
    return sorted(_entries())


@cache
def base_kind(name: str) -> type[DriveSettings]:
    """Return the model of a kind that is in ``base_kinds``. Any thread.

    Raises PluginError: the kind cannot be used, because its name is taken, it cannot be imported,
    or it is no subclass of ``DriveSettings`` that names its kinematics.
    """
    [entry, *others] = _entries()[name]
    if others:
        all_of_them = ", ".join(each.value for each in (entry, *others))
        raise PluginError(f"kind of base {name!r} exists more than once: {all_of_them}")
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


def base_models() -> Iterator[type[DriveSettings]]:
    """Yield the models of all kinds that can be used. Any thread."""
    for name in base_kinds():
        with suppress(PluginError):
            yield base_kind(name)


@cache
def _entries() -> dict[str, list[EntryPoint]]:
    found: dict[str, list[EntryPoint]] = {}
    for entry in entry_points(group=GROUP):
        found.setdefault(entry.name, []).append(entry)
    return found


def _by_kind(value: Any) -> DriveSettings:
    """Validate by the model that ``kind`` names.

    Unlike those of a tagged union, the keys of errors do not contain the kind.
    """
    if isinstance(value, DriveSettings):
        return value
    kind = value.get("kind", DEFAULT) if isinstance(value, dict) else DEFAULT
    if isinstance(kind, str) and kind in base_kinds():
        return base_kind(kind).model_validate(value)
    what = f"unknown kind of base (available: {', '.join(base_kinds()) or 'none'})"
    raise validation_error("drive", [(("kind",), what, kind)])


class AnyKind:
    """Annotation of a base of any kind: validated, written and described by its own model.

    The models are imported when one is needed, not with the descriptor.
    """

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            _by_kind, serialization=core_schema.simple_ser_schema("any")
        )

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return handler(
            core_schema.union_schema([each.__pydantic_core_schema__ for each in base_models()])
        )


Drive = Annotated[DriveSettings, AnyKind()]
