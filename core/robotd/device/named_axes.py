"""Names of axes in errors, and checks of arguments that need nothing else."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

from robotd.device.state import CommandMode
from robotd.errors import InvalidArgument, RobotdError, Unsupported

Error = TypeVar("Error", bound=RobotdError)

MIN_RATIO_PART, MAX_RATIO_PART = 1e-6, 2**31 - 1  # of a gear ratio's numerator and denominator


class NamedAxes:
    """Axes by number, whose errors carry their names.

    ``names``: per axis, for error texts (``joint2`` or ``axis 1``).
    """

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)

    def __len__(self) -> int:
        return len(self.names)

    def check_numbers(self, axes: Sequence[int]) -> None:
        """Raise InvalidArgument unless there is an axis, each exists, and none is given twice.

        None of the checks depends on the state of the device. A caller that takes one request for
        several axes makes them first, so that a wrong entry rejects the request as a whole. Any
        thread.
        """
        if not axes:
            raise InvalidArgument("no axis given")
        for axis in axes:
            if not 0 <= axis < len(self.names):
                raise InvalidArgument(f"axis {axis} is outside 0..{len(self.names) - 1}")
        if len(set(axes)) < len(axes):
            doubled = min(axis for axis, count in Counter(axes).items() if count > 1)
            raise InvalidArgument(f"axis {doubled} is given twice")

    def check_command_mode(self, axis: int, mode: int) -> None:
        """Raise InvalidArgument for a number that is not a ``CommandMode``."""
        if mode not in tuple(CommandMode):
            raise self.error(InvalidArgument, axis, f"mode {mode} is not 0, 1 or 2")

    def check_polarity(self, axis: int, polarity: int) -> None:
        """Raise InvalidArgument for another number than 1 and -1."""
        if polarity not in (1, -1):
            raise self.error(InvalidArgument, axis, f"polarity {polarity} is not 1 or -1")

    def check_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
        """Raise InvalidArgument for a part that is not within 1e-6 to 2147483647."""
        for part, value in (("numerator", numerator), ("denominator", denominator)):
            if not (math.isfinite(value) and MIN_RATIO_PART <= value <= MAX_RATIO_PART):
                reason = f"gear ratio {part} {value} is outside 1e-06..2147483647"
                raise self.error(InvalidArgument, axis, reason)

    def error(self, kind: type[Error], axis: int, reason: str) -> Error:
        """Return an error of ``axis``, which its text names."""
        error = kind(reason, axis=axis)
        error.axis_name = self.names[axis]
        return error

    @contextmanager
    def naming(self, axis: int | None = None) -> Iterator[None]:
        """Complete the errors of a driver: the commanded ``axis``, and the axis' name."""
        try:
            yield
        except RobotdError as error:
            if error.axis is None and not isinstance(error, Unsupported):
                error.axis = axis
            if error.axis is not None:
                error.axis_name = self.names[error.axis]
            raise
