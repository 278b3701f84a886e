"""Values by name of a request."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robotd.api import InvalidArgument


def taken(
    values: dict[str, Any], needed: Mapping[str, type], possible: Mapping[str, type]
) -> dict[str, Any]:
    """Return ``values``. Raises InvalidArgument: one is missing, unknown or of another type."""
    types = {**needed, **possible}
    given = {
        name: float(value) if type(value) is int and types.get(name) is float else value
        for name, value in values.items()
    }
    wrong = [
        name
        for name in {**needed, **given}
        if name not in types or name not in given or type(given[name]) is not types[name]
    ]
    if wrong:
        expected = ", ".join(f"{name} ({kind.__name__})" for name, kind in types.items())
        raise InvalidArgument(f"{', '.join(wrong)}: wrong or missing; expected {expected}")
    return given
