"""Detector of faults and changes of state in the frames of the control loop."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

import numpy as np

from robotd.arrays import BoolArray
from robotd.device.process_image import FLAGS, NUMBERS
from robotd.device.state import CommandMode, Operation
from robotd.events import Event, EventKind, Level
from robotd.observation.frame_ring import Frames

_ALARM, _SERVO, _OFFLINE = (FLAGS.index(name) for name in ("amp_alarm", "servo_on", "offline"))
_CODE, _MODE, _OPERATION = (NUMBERS.index(name) for name in ("alarm_code", "mode", "operation"))


class ChangeDetector:
    """Turns changes between successive frames into events. One thread.

    ``reasons``: the device's reasons of the axes, as ``FrameRing.reasons``.
    """

    def __init__(self, reasons: Collection[tuple[int, list[str]]], names: Sequence[str]) -> None:
        self._reasons = reasons
        self._names = names
        self._last: Frames | None = None

    def events(self, frames: Frames) -> Iterator[Event]:
        """Yield the events of ``frames``, which follow the ones of the last call."""
        if len(frames) == 0:
            return
        if self._last is None:
            self._last = frames[:1]
        joined = np.concatenate((self._last, frames))
        self._last = joined[-1:]
        flags, numbers = joined["flags"], joined["numbers"]
        changed = (flags[1:] != flags[:-1]).any(axis=1) | (numbers[1:] != numbers[:-1]).any(axis=1)
        ready = joined["ready"]
        for index in np.flatnonzero(changed.any(axis=1) | (ready[1:] != ready[:-1])).tolist():
            before, after = joined[index], joined[index + 1]
            if before["ready"] != after["ready"]:
                yield self._readiness(after)
            if not after["ready"]:
                continue  # start-up, shutdown, and a lost device, whose image is cleared
            for axis in np.flatnonzero(changed[index]).tolist():
                yield from self._axis(axis, joined[index:])

    def _readiness(self, after: np.void) -> Event:
        ready = bool(after["ready"])
        text = "device takes commands" if ready else "device takes no commands"
        level = Level.INFO if ready else Level.WARNING
        return Event(int(after["start_ns"]), EventKind.STATE, "device", text, level)

    def _axis(self, axis: int, frames: Frames) -> Iterator[Event]:
        """Yield the changes of ``axis`` between the first two of ``frames``."""
        before, after = frames[0], frames[1]
        time_ns, name = int(after["start_ns"]), self._names[axis]
        was, flags = before["flags"][:, axis], after["flags"][:, axis]
        old, numbers = before["numbers"][:, axis], after["numbers"][:, axis]
        data = {"axis": axis, **_values(after, axis)}
        if flags[_OFFLINE] and not was[_OFFLINE]:
            reason = self._reason(axis, frames[1:], frames[1:]["flags"][:, _OFFLINE, axis])
            text = f"{name}: drive is offline{reason}"
            yield Event(time_ns, EventKind.FAULT, name, text, Level.ERROR, data=data)
        is_new = not was[_ALARM] or old[_CODE] != numbers[_CODE]
        if flags[_ALARM] and is_new and not flags[_OFFLINE]:
            code = int(numbers[_CODE])
            same = frames[1:]["flags"][:, _ALARM, axis] & (
                frames[1:]["numbers"][:, _CODE, axis] == code
            )
            reason = self._reason(axis, frames[1:], same)
            text = f"{name}: amplifier alarm {code}{reason}"
            data = {**data, "code": code}
            yield Event(time_ns, EventKind.FAULT, name, text, Level.ERROR, data=data)
        if was[_ALARM] and not flags[_ALARM]:
            yield Event(time_ns, EventKind.STATE, name, f"{name}: alarm cleared", data=data)
        if was[_SERVO] != flags[_SERVO]:
            text = f"{name}: servo {'on' if flags[_SERVO] else 'off'}"
            yield Event(time_ns, EventKind.STATE, name, text, data=data)
        for row, kind in ((_MODE, CommandMode), (_OPERATION, Operation)):
            if old[row] != numbers[row]:
                word = kind(int(numbers[row])).name.lower()
                text = f"{name}: {kind.__name__.lower().removeprefix('command')} {word}"
                yield Event(time_ns, EventKind.STATE, name, text, Level.DEBUG, data=data)

    def _reason(self, axis: int, frames: Frames, lasts: BoolArray) -> str:
        """Return `` (reason)`` of a fault while it ``lasts``; "" without one.

        The last one: a device may learn the reason some periods after the fault.
        """
        end = len(frames) if lasts.all() else int(np.argmin(lasts))
        end_ns, reason = int(frames["start_ns"][end - 1]), ""
        for since_ns, reasons in [*self._reasons]:  # the control loop adds to them
            if since_ns <= end_ns:
                reason = reasons[axis]
        return f" ({reason})" if reason else ""


def _values(frame: np.void, axis: int) -> dict[str, float]:
    """Return the values of an axis, without those that are not known."""
    names = ("position_command", "velocity_command", "position", "velocity", "torque")
    values = zip(names, frame["values"][:, axis].tolist(), strict=True)
    return {name: value for name, value in values if value == value}  # noqa: PLR0124 - NaN
