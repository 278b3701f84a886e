"""Commands to several axes, one after the other."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence


def each(axes: Sequence[int], command: Callable[[int], None]) -> Mapping[int, Exception | None]:
    """Run a one-axis command on every axis; return error or None of each."""
    results: dict[int, Exception | None] = {}
    for axis in axes:
        try:
            command(axis)
            results[axis] = None
        except Exception as error:  # noqa: BLE001 - the caller reports every axis
            results[axis] = error
    return results
