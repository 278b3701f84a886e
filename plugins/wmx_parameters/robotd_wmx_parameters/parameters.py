"""The WMX parameters of 128 axes, column by column.

Values are in the vendor's units (user unit of the axis, ms, %), because that is what the file
and the engine hold; a backend converts. Nothing here touches a file: see ``xml_file``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robotd.api import DescriptorError, NotReady, did_you_mean
from robotd_wmx_parameters.element_table import (
    AXIS_SECTIONS,
    GLOBAL_SECTIONS,
    Kind,
    Parameter,
    Sections,
)

N_AXES = 128
MIN_GEAR_RATIO, MAX_GEAR_RATIO = 1e-6, 2**31 - 1
"""Limits of numerator / denominator, pulses per user unit, set by the engine."""

GEAR_RATIO_TOLERANCE = 1e-6
"""Relative; files of the engine have six decimals, so 2π comes back as 6.283185."""
SCALING_PARAMETERS = (
    "AxisPolarity",
    "AxisCommandMode",
    "SingleTurnMode",
    "SingleTurnEncoderCount",
    "AbsoluteEncoderMode",
    "AbsoluteEncoderHomeOffset",
    "EncoderRangeMode",
    "EncoderRangeLow",
    "EncoderRangeHigh",
)
"""With the gear ratio: parameters that decide what the position of a drive means."""

Column = NDArray[Any]
Scalar = float | int | bool


def _by_name(sections: Sections) -> dict[str, Parameter]:
    return {item.name: item for section in sections.values() for item in section}


AXIS_PARAMETERS = _by_name(AXIS_SECTIONS)
GLOBAL_PARAMETERS = _by_name(GLOBAL_SECTIONS)

_DTYPES: dict[Kind, type[Any]] = {Kind.REAL: np.float64, Kind.FLAG: np.bool_}


@dataclass(frozen=True, eq=False)
class WmxParameters:
    """Parameters as read from a file, or the vendor's defaults. Immutable.

    ``parameters["AxisPolarity"]`` is the column of all axes, shape (128,), read-only: float64
    for real numbers, bool for flags, int64 for everything else.

    Attributes:
        columns: element name → column.
        global_values: element name → value, for what is not of an axis.
        missing: element name → axes for which the file does not state it, so that it has the
            default here; empty tuple for a global element. The engine itself would take 0.
        path: the file; None when there is none.
    """

    columns: Mapping[str, Column]
    global_values: Mapping[str, Scalar]
    missing: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    path: Path | None = None

    def __getitem__(self, name: str) -> Column:
        """Return the column of an element. Raises KeyError naming the nearest element."""
        try:
            return self.columns[name]
        except KeyError:
            hint = did_you_mean(name, self.columns)
            raise KeyError(f"unknown WMX parameter {name!r}{hint}") from None

    def axis(self, axis: int) -> Mapping[str, Scalar]:
        """Return all parameters of one axis by element name, as Python numbers."""
        return {name: column[axis].item() for name, column in self.columns.items()}

    def with_values(self, changes: Mapping[str, Mapping[int, Scalar]]) -> WmxParameters:
        """Return a copy with ``changes``: element name → axis → value.

        Raises DescriptorError naming element, axis, value and limit; KeyError naming the nearest
        element.
        """
        columns = dict(self.columns)
        for name, values in changes.items():
            column = np.array(self[name], dtype=np.float64)
            for axis, value in values.items():
                column[axis] = value
            columns[name] = checked_column(AXIS_PARAMETERS[name], column)
        problems = list(gear_problems(columns))
        if problems:
            raise DescriptorError.join(DescriptorError(text) for _, text in problems)
        return WmxParameters(columns, self.global_values, self.missing, self.path)

    def missing_summary(self, axes: int = N_AXES) -> str:
        """Return one line that lists the missing elements; empty when the file is complete.

        Args:
            axes: number of axes of the robot, from axis 0; the others' elements do not count.
        """
        by_axes: dict[tuple[int, ...], list[str]] = {}
        for name, where in self.missing.items():
            used = tuple(axis for axis in where if axis < axes)
            if used or not where:
                by_axes.setdefault(used, []).append(name)
        shown = [f"{axes_text(where)}: {', '.join(names)}" for where, names in by_axes.items()]
        if not shown:
            return ""
        return f"missing elements, which get their defaults: {'; '.join(shown)}"

    def absent_axes(self, axes: int) -> tuple[int, ...]:
        """Return those of the first ``axes`` axes that the file does not contain."""
        stated = set(range(axes))
        for name in AXIS_PARAMETERS:
            stated &= set(self.missing.get(name, ()))
        return tuple(sorted(stated))


def default_wmx_parameters() -> WmxParameters:
    """Return the vendor's default of every parameter on all axes."""
    columns = {
        name: checked_column(item, np.full(N_AXES, float(item.default)))
        for name, item in AXIS_PARAMETERS.items()
    }
    values = {name: global_value(item, item.default) for name, item in GLOBAL_PARAMETERS.items()}
    return WmxParameters(MappingProxyType(columns), MappingProxyType(values))


def require_same_scaling(
    before: Mapping[str, Column], after: Mapping[str, Column], axes: Iterable[int]
) -> None:
    """Check a set of parameters that is about to be loaded while servos are on.

    A live axis whose scale changes is suddenly somewhere else: it would jump there with the next
    command, and its limits would mean another place.

    Args:
        before: columns in force; those of ``SCALING_PARAMETERS``.
        after: columns to load.
        axes: whose servo is on.

    Raises NotReady naming each axis and parameter with both values.
    """
    changes = [change for axis in axes for change in _scaling_changes(before, after, axis)]
    if changes:
        raise NotReady(
            f"parameters cannot be loaded while servos are on: {'; '.join(changes)};"
            " switch these servos off first"
        )


def _scaling_changes(
    before: Mapping[str, Column], after: Mapping[str, Column], axis: int
) -> Iterator[str]:
    for name in SCALING_PARAMETERS:
        was, becomes = (float(columns[name][axis]) for columns in (before, after))
        if was != becomes:
            yield f"axis {axis} would change {name} from {was:.15g} to {becomes:.15g}"
    was, becomes = (_pulses_per_unit(columns, axis) for columns in (before, after))
    if abs(becomes - was) > GEAR_RATIO_TOLERANCE * was:
        yield (
            f"axis {axis} would change AxisGearRatioNumerator / AxisGearRatioDenominator"
            f" from {was:.9g} to {becomes:.9g} pulses per unit"
        )


def _pulses_per_unit(columns: Mapping[str, Column], axis: int) -> float:
    numerator, denominator = columns["AxisGearRatioNumerator"], columns["AxisGearRatioDenominator"]
    return float(numerator[axis]) / float(denominator[axis])


def column_problems(item: Parameter, column: NDArray[np.float64]) -> Iterator[tuple[int, str]]:
    """Yield each index whose value is invalid for ``item``, and why."""
    good = (column >= item.low) & (column <= item.high)
    if item.kind is Kind.SIGN:
        good &= np.abs(column) == 1
    elif item.kind is not Kind.REAL:
        good &= np.trunc(column) == column
    for index in np.flatnonzero(~good):
        yield int(index), _rejection(item, float(column[index]))


def gear_problems(columns: Mapping[str, Column]) -> Iterator[tuple[int, str]]:
    """Yield each axis whose gear ratio the engine rejects, and why."""
    ratio = columns["AxisGearRatioNumerator"] / columns["AxisGearRatioDenominator"]
    for axis in np.flatnonzero(~((ratio >= MIN_GEAR_RATIO) & (ratio <= MAX_GEAR_RATIO))):
        limits = f"{MIN_GEAR_RATIO:g} to {MAX_GEAR_RATIO}"
        yield int(axis), f"gear ratio of axis {axis} must be {limits} (value {ratio[axis]:g})"


def checked_column(item: Parameter, column: NDArray[np.float64]) -> Column:
    """Return ``column`` in the dtype of ``item``, read-only. Raises DescriptorError."""
    problems = [
        DescriptorError(f"{item.name} of axis {axis} {text}")
        for axis, text in column_problems(item, column)
    ]
    if problems:
        raise DescriptorError.join(problems)
    typed = column.astype(_DTYPES.get(item.kind, np.int64))
    typed.flags.writeable = False
    return typed


def global_value(item: Parameter, value: float) -> Scalar:
    """Return ``value`` in the type of ``item``."""
    return float(value) if item.kind is Kind.REAL else _whole_value(item, value)


def _whole_value(item: Parameter, value: float) -> Scalar:
    return bool(value) if item.kind is Kind.FLAG else int(value)


def _rejection(item: Parameter, value: float) -> str:
    unit = f" {item.unit}" if item.unit else ""
    if item.kind in (Kind.FLAG, Kind.SIGN):
        return f"must be {item.kind.value} (value {value:.15g})"
    enum = f" of {item.enum}" if item.enum else ""
    limits = f"from {item.low:.15g} to {item.high:.15g}{unit}"
    return f"must be {item.kind.value}{enum} {limits} (value {value:.15g})".replace(
        "a number of an enumeration of", "a whole number of"
    )


def axes_text(axes: tuple[int, ...]) -> str:
    """Format axes: ``axis 3``, ``axes 3..5``, ``axes 0, 2``, or ``global`` for none."""
    if not axes:
        return "global"
    if axes == tuple(range(axes[0], axes[-1] + 1)):
        return f"axis {axes[0]}" if len(axes) == 1 else f"axes {axes[0]}..{axes[-1]}"
    return "axes " + ", ".join(str(axis) for axis in axes)
