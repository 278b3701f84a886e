"""Judgements of the commissioning steps: measured values in, changes of the descriptor out.

Pure functions. A value that cannot be right raises ``OperationError`` with what to do.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from types import MappingProxyType
from typing import Any

from robotd.api import BusNode, OperationError
from robotd.api.models import JointSettings

MIN_MOVE = {"rad": math.radians(0.5), "m": 0.5e-3}  # of a joint that was moved on purpose
MIN_SCALE_MOVE = {"rad": math.radians(5.0), "m": 5e-3}  # below it, reading errors dominate
SAME_END = {"rad": math.radians(0.5), "m": 0.5e-3}  # of travel
MAX_SAG = {"rad": math.radians(0.5), "m": 0.5e-3}  # of an axis on its brake
MIN_WINDOW = {"rad": math.radians(1.0), "m": 1e-3}
SAME_SCALE = 0.02  # part; an angle is read from a scale with about 1 %
WINDOW_MARGIN = 2.0  # over the lag that is expected at full speed
MAX_FACTOR = 10  # recognised as a whole number; further ones are too close to each other


class DescriptorPart(StrEnum):
    """Part of the descriptor that a change belongs to."""

    JOINT = "joint"
    DRIVE = "drive"  # the item of the backend's section


@dataclass(frozen=True)
class Change:
    """New value of one key."""

    place: DescriptorPart
    key: str
    value: Any


@dataclass(frozen=True)
class StepFinding:
    """Result of one step.

    Attributes:
        text: for people and for the record.
        changes: of the descriptor; empty where it is right.
    """

    text: str
    changes: tuple[Change, ...] = field(default=())


def in_words(value: float, unit: str) -> str:
    """Return a position for people: degrees of ``rad``, millimetres of ``m``."""
    shown, name = (math.degrees(value), "°") if unit == "rad" else (1e3 * value, " mm")
    return f"{round(shown, 2) + 0.0:+.2f}{name}"  # + 0.0: no minus before a zero


def judge_identity(node: BusNode, expected: Mapping[str, Any], key: str) -> StepFinding:
    """Compare the identity of a drive with the descriptor's, or propose it.

    Args:
        expected: ``vendor_id`` and others that the descriptor demands; None: not compared.
        key: of the identity in the axis' section.
    """
    found = {"vendor_id": node.vendor_id, "product_code": node.product_code}
    name = f"node {node.id} is vendor 0x{node.vendor_id:08X}, product 0x{node.product_code:08X}"
    if node.offline:
        raise OperationError(f"node {node.id} is offline: {node.fault or 'no answer'}")
    if not node.vendor_id:
        return StepFinding(f"node {node.id} states no identity; nothing to compare")
    known = {name: value for name, value in expected.items() if value is not None}
    wrong = [name for name in found if name in known and known[name] != found[name]]
    if wrong:
        demanded = ", ".join(f"{name} 0x{known[name]:08X}" for name in wrong)
        raise OperationError(
            f"{name}; the descriptor demands {demanded}: another drive has this node id, or the"
            " descriptor is that of another machine"
        )
    if known:
        return StepFinding(f"{name}, as in the descriptor")
    return StepFinding(name, (Change(DescriptorPart.DRIVE, key, found),))


def judge_direction(
    reported: float, *, positive: bool, polarity: int, key: str, unit: str
) -> StepFinding:
    """Compare the reported motion with the true direction.

    Args:
        reported: change of the position, rad or m.
        positive: the joint moved in its positive direction.
        polarity: of the descriptor, 1 or -1.
        unit: ``rad`` or ``m``.
    """
    if abs(reported) < MIN_MOVE[unit]:
        raise OperationError(
            f"the position changed by {in_words(reported, unit)} only: move the joint further; if"
            " it did move, another drive belongs to it, or the scale is far too small"
        )
    if (reported > 0.0) is positive:
        return StepFinding(
            f"the position changed by {in_words(reported, unit)}: direction is right"
        )
    return StepFinding(
        f"the position changed by {in_words(reported, unit)}: the drive counts the other way,"
        f" {key} {polarity} becomes {-polarity}",
        (Change(DescriptorPart.DRIVE, key, -polarity),),
    )


def judge_scale(
    reported: float,
    true: float,
    scale: float,
    key: str,
    unit: str,
    stated: Mapping[str, float] = MappingProxyType({}),
) -> StepFinding:
    """Compare the reported motion with a known one.

    Counts are reported · scale, so the right scale is that divided by ``true``. A scale that is
    wrong by a whole factor, as a forgotten gear ratio, is corrected by exactly that factor. A
    scale that the drive states is taken if the measured one is near it.

    Args:
        reported, true: change of the position, rad or m.
        scale: counts per rad (or m) of the descriptor.
        unit: ``rad`` or ``m``.
        stated: counts per turn by the drive's own objects.
    """
    if abs(true) < MIN_SCALE_MOVE[unit]:
        least = in_words(MIN_SCALE_MOVE[unit], unit)
        raise OperationError(
            f"{in_words(true, unit)} is too little to measure by: at least {least}"
        )
    if not reported * true > 0.0:
        raise OperationError(
            f"{in_words(true, unit)} is reported as {in_words(reported, unit)}: the direction is"
            " wrong or the joint did not move"
        )
    ratio = reported / true
    what = f"{in_words(true, unit)} is reported as {in_words(reported, unit)}"
    if abs(ratio - 1.0) < SAME_SCALE:
        return StepFinding(f"{what}: {key} {scale:.10g} is right, within {SAME_SCALE:.0%}")
    for name, turn in stated.items():
        new = float(f"{turn / math.tau:.10g}")
        if abs(scale * ratio / new - 1.0) < SAME_SCALE:
            return StepFinding(
                f"{what}: {key} {scale:.10g} becomes {new:.10g} (the drive's {name})",
                (Change(DescriptorPart.DRIVE, key, new),),
            )
    factor = _whole_factor(ratio)
    is_whole = factor is not None
    new = float(f"{scale * (factor or ratio):.10g}")
    why = (
        f"wrong by a factor of {_factor_text(ratio)}" if is_whole else f"{ratio:.4f} times as many"
    )
    return StepFinding(
        f"{what}: {key} {scale:.10g} becomes {new:.10g} ({why})",
        (Change(DescriptorPart.DRIVE, key, new),),
    )


def judge_limits(lower: float, upper: float, joint: JointSettings) -> StepFinding:
    """Compare the ends of the free travel (rad or m) with the joint's limits."""
    unit, (low, high) = joint.unit, sorted((lower, upper))
    if high - low < MIN_SCALE_MOVE[unit]:
        raise OperationError(f"the ends are only {in_words(high - low, unit)} apart")
    changes = []
    for key, found, limit in (("lower_rad", low, joint.lower), ("upper_rad", high, joint.upper)):
        if abs(found - limit) > SAME_END[unit]:
            inward = math.ceil(found * 1e4) if key == "lower_rad" else math.floor(found * 1e4)
            changes.append(Change(DescriptorPart.JOINT, joint.key(key), inward / 1e4))
    travel = f"the travel is {in_words(low, unit)} to {in_words(high, unit)}"
    if not changes:
        return StepFinding(f"{travel}, as in the descriptor")
    return StepFinding(f"{travel}; new limits", tuple(changes))


def judge_following_error(
    lag_s: float, joint: JointSettings, scale: float, window_object: str
) -> StepFinding:
    """Propose a following-error window from the measured lag.

    A position loop without feed-forward follows with a constant lag, so the error at the joint's
    full speed is lag · speed. The window is twice that.

    Args:
        lag_s: largest error over the speed at which it was measured.
        joint: its velocity is the full speed.
        scale: counts per rad (or m).
        window_object: of the drive; "": nothing is written.
    """
    error = lag_s * joint.velocity
    window = max(WINDOW_MARGIN * error, MIN_WINDOW[joint.unit])
    text = (
        f"the axis follows {1e3 * lag_s:.0f} ms late, {in_words(error, joint.unit)} at full speed;"
        f" following-error window {in_words(window, joint.unit)}"
    )
    if not window_object:
        return StepFinding(f"{text}: set it in the drive")
    return StepFinding(text, (Change(DescriptorPart.DRIVE, window_object, round(window * scale)),))


def judge_brake(sag: float, unit: str) -> StepFinding:
    """Judge how far the axis moved when its servo went off, rad or m."""
    if abs(sag) > MAX_SAG[unit]:
        raise OperationError(
            f"the axis moved by {in_words(sag, unit)} when its servo went off: the brake does not"
            f" hold (limit {in_words(MAX_SAG[unit], unit)}); support the load before you go on"
        )
    return StepFinding(f"the axis moved by {in_words(sag, unit)} when its servo went off: it holds")


def _whole_factor(ratio: float) -> float | None:
    """Return n or 1/n near ``ratio``; None where neither is."""
    n = round(max(ratio, 1.0 / ratio))
    factor = float(n) if ratio > 1.0 else 1.0 / n
    return factor if 2 <= n <= MAX_FACTOR and abs(ratio / factor - 1.0) < SAME_SCALE else None


def _factor_text(ratio: float) -> str:
    return f"{round(ratio)}" if ratio > 1.0 else f"1/{round(1.0 / ratio)}"
