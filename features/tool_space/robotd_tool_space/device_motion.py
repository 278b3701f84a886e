"""Moves and jogs of single axes, which run in the device."""

from __future__ import annotations

from collections.abc import Sequence

from robotd.api import Operation, ProcessImage


def moved_by_device(image: ProcessImage, axes: Sequence[int]) -> list[int]:
    """Return those of ``axes`` that a move or a jog moves, by the device's own profile."""
    by_device = (Operation.POSITION, Operation.VELOCITY)
    return [axis for axis in axes if image.operation[axis] in by_device]
