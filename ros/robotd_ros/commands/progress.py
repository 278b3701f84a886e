"""Progress line of a motion, on a terminal only."""

from __future__ import annotations

import math
import shutil
import sys
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress

import click

_CLEAR_LINE = "\r\x1b[K"


BAR_WIDTH = 20


def bar(part: float) -> str:
    """Return a bar of ``BAR_WIDTH`` characters that is filled to ``part``, 0 to 1."""
    filled = round(min(max(part, 0.0), 1.0) * BAR_WIDTH)
    return "━" * filled + "╌" * (BAR_WIDTH - filled)


class Progress:
    """Shows the progress of a motion on standard error, on one line.

    Args:
        joints: those to show.
        time_s: planned duration.
        degrees: joints that are shown in degrees instead of radians.
    """

    def __init__(
        self, joints: Sequence[str], time_s: float, *, degrees: Collection[str] = ()
    ) -> None:
        self._joints = joints
        self._time_s = time_s
        self._degrees = degrees
        self._shown = False

    def show(self, passed_s: float, positions: Mapping[str, float]) -> None:
        """Show the seconds since the start, and ``positions`` in rad or m."""
        if not sys.stderr.isatty():
            return
        values = "  ".join(
            f"{joint} {self._text(joint, positions[joint])}" for joint in self._joints
        )
        line = f"{bar(passed_s / self._time_s)} {passed_s:.1f} of {self._time_s:.1f} s  {values}"
        width = shutil.get_terminal_size().columns - 1
        self._print(f"{_CLEAR_LINE}{line[:width]}")
        self._shown = True

    def end(self) -> None:
        """Clear the line."""
        if self._shown:
            self._print(_CLEAR_LINE)
            self._shown = False

    def _print(self, text: str) -> None:
        with suppress(OSError):  # of a lost terminal: the motion still has to be canceled
            click.echo(text, nl=False, err=True)

    def _text(self, joint: str, position: float) -> str:
        is_angle = joint in self._degrees
        return f"{math.degrees(position):+.1f}°" if is_angle else f"{position:+.3f}"
