"""Habits of real drives that must not become motion: late modes, lost answers, own stops."""

from __future__ import annotations

from tests.plugins.cia402.looped_drive import LoopedDrive

from robotd_cia402.modes import OperationMode
from robotd_cia402.object_numbers import MODE


def change_modes_late(looped: LoopedDrive, frames: int) -> None:
    """Let the drive change its mode some frames after the request."""
    send, requested = looped.objects.send, [looped.objects.dictionary[MODE, 0]] * frames

    def late() -> None:
        send()
        requested.append(looped.objects.dictionary[MODE, 0])
        looped.objects.dictionary[MODE, 0] = requested.pop(0)

    looped.objects.send = late  # type: ignore[method-assign]


def test_a_drive_that_leaves_homing_late_does_not_home_again() -> None:
    """Bit 4 enables interpolation in one mode, and starts a homing in the other."""
    looped = LoopedDrive(stream_mode="ip", homing_method=37)
    looped.commands.enable(1.0)
    begin, begun = looped.drive.motion._begin_homing, list[int]()

    def note(method: int) -> None:
        begun.append(method)
        begin(method)

    looped.drive.motion._begin_homing = note  # type: ignore[method-assign]
    change_modes_late(looped, 5)
    looped.commands.home(5.0)
    looped.run(0.2)
    assert looped.axis.report.displayed_mode == OperationMode.INTERPOLATED_POSITION
    assert begun == [37]
