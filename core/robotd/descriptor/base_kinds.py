"""Kinds of mobile bases, by entry points of the group ``robotd.bases``.

``NAME = "package.module:Class"`` leads to a subclass of ``DriveSettings``; ``drive: {kind: NAME}``
chooses it.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from contextlib import suppress
from functools import lru_cache
from typing import Annotated, Any

from pydantic import GetJsonSchemaHandler, ValidationError
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from robotd.descriptor.drive_settings import DriveSettings
from robotd.descriptor.section import validation_error
from robotd.entry_points import installed_names, load_entry, owner_of, plugin_errors
from robotd.errors import PluginError, unknown_name

GROUP = "robotd.bases"
_TARGET = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_][\w.]*")
DEFAULT = "differential"  # of a section without ``kind``


def base_kinds() -> list[str]:
    """Return the names of all kinds, sorted. Any thread."""
    names = installed_names(GROUP)
    return sorted({*names.entries, *(origin.name for origin in names.refused)})


def base_kind(name: str) -> type[DriveSettings]:
    """Return the model of a kind that is in ``base_kinds``. Any thread.

    Raises PluginError: the kind cannot be used, because its name is taken, it cannot be imported,
    or it is not a subclass of ``DriveSettings`` that names its kinematics.
    """
    return _load(tuple(sys.path), name)


@lru_cache(maxsize=64)
def _load(path: tuple[str, ...], name: str) -> type[DriveSettings]:
    del path
    found = installed_names(GROUP).require(name)
    if found is None:
        raise PluginError(unknown_name("kind of base", name, base_kinds()))
    kind = load_entry(*found)
    if not (isinstance(kind, type) and issubclass(kind, DriveSettings)):
        raise PluginError(f"kind of base {found[0]}: must be a subclass of DriveSettings")
    if not _TARGET.fullmatch(str(kind.KINEMATICS)):
        what = f"KINEMATICS must be package.module:function (value {kind.KINEMATICS!r:.60})"
        raise PluginError(f"kind of base {found[0]}: {what}")
    return kind


def base_models() -> Iterator[type[DriveSettings]]:
    """Yield the models of all kinds that can be used. Any thread."""
    for name in base_kinds():
        with suppress(PluginError):
            yield base_kind(name)


def _by_kind(value: Any) -> DriveSettings:
    """Validate by the model that ``kind`` names.

    Unlike those of a tagged union, the keys of errors do not contain the kind.
    """
    if isinstance(value, DriveSettings):
        return value
    kind = value.get("kind", DEFAULT) if isinstance(value, dict) else DEFAULT
    if isinstance(kind, str) and kind in base_kinds():
        model = base_kind(kind)
        what = f"kind of base {kind!r} of {owner_of(model.__module__)}"
        with plugin_errors(what, model.__module__, unchanged=(ValidationError,)):
            return model.model_validate(value)
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
            core_schema.union_schema([model.__pydantic_core_schema__ for model in base_models()])
        )


Drive = Annotated[DriveSettings, AnyKind()]
