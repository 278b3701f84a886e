"""Interruptions of motion: numbered, so that none is missed between two commands of a client."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from robotd.arrays import BoolArray
from robotd.control.completion import Completion, Outcome
from robotd.device.axes import Axes
from robotd.device.process_image import ProcessImage
from robotd.device.state import CommandMode
from robotd.errors import NotReady


class Interruption(NamedTuple):
    """Beginning of a state in which motion is rejected.

    Attributes:
        number: unique, and larger than those before it.
    """

    number: int
    reason: str


class Interruptions:
    """Newest interruptions of motion of a robot, of all its axes and of each.

    Motion is rejected while it is stopped, paused or not allowed by a lifecycle manager, while the
    device is not ready, and for an axis with a fault, with its servo off or in another command
    mode. A motion that is ended by a stop or a fault counts as well (``add``).
    """

    def __init__(self, axes: Axes) -> None:
        self._axes, self._connection = axes, axes.connection
        self._numbers = itertools.count(1)
        self._all = self._pause = Interruption(0, "")
        self._of_axis = [self._all] * len(axes)
        self._of_mode = [self._all] * len(axes)
        self._unable: BoolArray = np.zeros(len(axes), np.bool_)  # in the last image, like the modes
        self._modes = axes.image.mode.copy()
        self._seen = b""
        self._inactive = ""
        axes.stop_latch.on_change(self._on_stop)
        axes.speed.on_change(self._on_speed)
        axes.connection.on_ready(self._on_ready)

    def add(self, axes: Sequence[int], reason: str) -> None:
        """Note that motion of ``axes`` was ended by a stop or a fault. Any thread."""
        for axis in axes:
            self._of_axis[axis] = self._interruption(reason)

    def watch(self, completion: Completion, axes: Sequence[int]) -> None:
        """Note an end by a stop or a fault of a motion of ``axes``.

        Before the motion is submitted.
        """
        noted = False

        def note() -> None:
            nonlocal noted
            # A cancelled motion can end with a fault: both count, what was asked for and what came.
            ends = completion.requested, (completion.outcome, completion.message)
            for outcome, message in filter(None, ends):
                if outcome in (Outcome.STOPPED, Outcome.FAULT) and not noted:
                    noted = True
                    self.add(axes, message)

        completion.on_end = note

    def look(self, image: ProcessImage) -> None:
        """Note what cannot move any more. Control loop, once a period."""
        inactive, before = self._axes.stop_latch.inactive, self._inactive
        self._inactive = inactive
        if inactive and not before:
            self._all = self._interruption(f"the robot was {inactive}")
        seen = image.flags.tobytes() + image.mode.tobytes()
        if seen == self._seen:
            return
        self._seen, names = seen, self._axes.names
        unable: BoolArray = image.amp_alarm | image.offline | ~image.servo_on
        for axis in np.flatnonzero(unable & ~self._unable).tolist():
            reason = image.fault(axis) or "servo off"
            self._of_axis[axis] = self._interruption(f"{names[axis]}: {reason}")
        for axis in np.flatnonzero(image.mode != self._modes).tolist():
            self._of_mode[axis] = self._interruption(f"{names[axis]}: another command mode")
        self._unable, self._modes = unable, image.mode.copy()

    def newest(
        self, axes: Sequence[int], *, in_mode: bool, follows_speed: bool
    ) -> list[Interruption]:
        """Return those that concern the commands of ``axes``, always as many. Any thread.

        Args:
            in_mode: they need the axes in a certain mode.
            follows_speed: their motion slows down in a pause and continues after it.
        """
        found = [self._all, *(self._of_axis[axis] for axis in axes)]
        if in_mode:
            found += [self._of_mode[axis] for axis in axes]
        return found if follows_speed else [*found, self._pause]

    def present(
        self, axes: Sequence[int], modes: Sequence[CommandMode], *, follows_speed: bool
    ) -> NotReady | None:
        """Return the error of a motion command now; None: no state rejects it. Any thread.

        Owners do not count. An axis has to be unable to move in the last whole image as well: the
        next one may just be written.

        Args:
            modes: that it needs; empty: any.
            follows_speed: see ``newest``.
        """
        if rejection := self._axes.stop_latch.rejection:
            return NotReady(rejection)
        if not self._connection.commandable:
            return NotReady(self._connection.rejection)
        if not follows_speed and (rejection := self._axes.speed.rejection):
            return NotReady(rejection)
        for axis, mode in zip(axes, modes or self._modes[list(axes)], strict=True):
            if self._unable[axis] or self._modes[axis] != mode:
                owner = self._axes.owner(axis)
                if error := self._axes.inability(axis, CommandMode(int(mode)), owner):
                    return error
        return None

    def _interruption(self, reason: str) -> Interruption:
        return Interruption(next(self._numbers), reason)

    def _on_stop(self, reason: str) -> None:
        if reason:
            self._all = self._interruption(f"stopped: {reason}")

    def _on_speed(self, scale: float) -> None:
        if not scale:
            self._pause = self._interruption(self._axes.speed.text)

    def _on_ready(self, ready: bool) -> None:
        if not ready:
            self._all = self._interruption("the device was not ready")
