"""Base class and value types of the descriptor's sections."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

MAX_AXES = 128

Key = tuple[str | int, ...]
"""Path of a key below a model: names of keys and places in lists."""

Problem = tuple[Key, str, Any]
"""Key below the model, problem, and the value that has it."""


NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
Name = Annotated[str, Field(pattern=f"^{NAME.pattern}$")]
Axis = Annotated[int, Field(ge=0, lt=MAX_AXES)]
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
File = Annotated[Path, Field(strict=False)]


class Section(BaseModel):
    """Base of every section: frozen, no unknown key, no conversion, no infinity.

    Attributes:
        on_request: keys of a feature that are read when a program asks for it, and missed by no
            program that does not.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)
    on_request: ClassVar[bool] = False

    def problems(self) -> Iterator[Problem]:
        """Yield cross-field validation errors."""
        yield from ()

    @model_validator(mode="after")
    def _between_keys(self) -> Self:
        if problems := [*self.problems()]:
            raise validation_error(type(self).__name__, problems)
        return self


def validation_error(title: str, problems: Iterable[Problem]) -> ValidationError:
    """Return the error of pydantic with ``problems``; ``title``: name of the model."""
    details = [
        InitErrorDetails(
            type=PydanticCustomError("robotd", "{what}", {"what": what}), loc=keys, input=value
        )
        for keys, what, value in problems
    ]
    return ValidationError.from_exception_data(title, details)


def twice(
    key: str, items: Iterable[tuple[str | int, str | int]], subkey: str | None = None
) -> Iterator[Problem]:
    """Yield a problem for every value that occurs twice in the list or mapping ``key``.

    ``items``: places and values; ``subkey``: key of the value in each place, None: it is the place.
    """
    first: dict[str | int, str | int] = {}
    for place, value in items:
        if value in first:
            keys = (key, place) if subkey is None else (key, place, subkey)
            yield keys, f"used before, by {key}.{first[value]}", value
        first.setdefault(value, place)
