"""Numbers on the command line.

Underscores, which Python allows in numbers, are rejected: 1_0 is a slip, not 10.
"""

from __future__ import annotations

import math
from typing import Any

import click


def parse_integer(text: str, base: int = 0) -> int:
    """Return an integer; base 0: decimal, or hexadecimal with 0x. Raises ValueError."""
    return int(_plain(text), base)


def parse_number(text: str) -> float:
    """Return a number, also infinity and NaN. Raises ValueError."""
    return float(_plain(text))


def _plain(text: str) -> str:
    if "_" in text:
        raise ValueError(f"{text!r} is not a number")
    return text


class _PlainDigits(click.ParamType):  # type: ignore[type-arg] # generic since click 8.2
    """Type of numbers without underscores."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if isinstance(value, str) and "_" in value:
            self.fail(f"{value!r} is not a number", param, ctx)
        return super().convert(value, param, ctx)

    def _describe_range(self) -> str:
        """Return the limits for the help; click writes "x<=None" where there are none."""
        own: Any = self
        if own.min is own.max is None:
            return ""
        return str(super()._describe_range())  # type: ignore[misc] # of the ranges below


class IntegerRange(_PlainDigits, click.IntRange):
    """Range of decimal integers, for options and arguments of a command; all without limits."""

    name = "integer"  # error texts have it: click's own is "integer range"


class NumberRange(_PlainDigits, click.FloatRange):
    """Range of numbers, for options and arguments of a command; NaN is in none."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if math.isnan(number := super().convert(value, param, ctx)):
            self.fail("nan is not a number", param, ctx)
        return number


class ObjectNumber(click.ParamType):  # type: ignore[type-arg] # generic since click 8.2
    """Integer as manuals of drives write it, for a command: decimal, or hexadecimal with 0x.

    Args:
        bits: of a signed integer that holds it; None: no limit.
    """

    name = "number"

    def __init__(self, bits: int | None = None) -> None:
        self._bits = bits

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        try:
            number = value if isinstance(value, int) else parse_integer(value)
        except ValueError:
            self.fail(f"{value!r} is not a number", param, ctx)
        if self._bits is not None and not -(1 << self._bits - 1) <= number < 1 << self._bits - 1:
            last = self._bits - 1
            self.fail(f"{value} is outside -2^{last} .. 2^{last} - 1", param, ctx)
        return number
