"""Base class and value types of the descriptor's sections."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

MAX_AXES = 128

Problem = tuple[tuple[str | int, ...], str, Any]
"""Key path below the model, problem, and the value that has it."""


Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")]
Axis = Annotated[int, Field(ge=0, lt=MAX_AXES)]
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
File = Annotated[Path, Field(strict=False)]


class Section(BaseModel):
    """Base of every section: frozen, no unknown key, no conversion, no infinity."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    def problems(self) -> Iterator[Problem]:
        """Yield cross-field validation errors."""
        yield from ()

    @model_validator(mode="after")
    def _between_keys(self) -> Self:
        details = [
            InitErrorDetails(type=PydanticCustomError("robotd", "{what}", {"what": what}),
                             loc=keys, input=value)
            for keys, what, value in self.problems()
        ]  # fmt: skip
        if details:
            raise ValidationError.from_exception_data(type(self).__name__, details)
        return self


def twice(key: str, values: Iterable[str | int], subkey: str | None = None) -> Iterator[Problem]:
    """Yield a problem for every value that occurs twice in the list ``key``."""
    first: dict[str | int, int] = {}
    for index, value in enumerate(values):
        if value in first:
            keys = (key, index) if subkey is None else (key, index, subkey)
            yield keys, f"used before, by {key}.{first[value]}", value
        first.setdefault(value, index)
