"""Numbers on the command line, as manuals of drives write them."""

from __future__ import annotations

from typing import Any

import click


class _Number(click.ParamType):  # type: ignore[type-arg] # generic since click 8.2
    """Decimal, or hexadecimal with 0x."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        try:
            return value if isinstance(value, int) else int(value, 0)
        except ValueError:
            self.fail(f"{value!r} is not a number", param, ctx)


NUMBER = _Number()
