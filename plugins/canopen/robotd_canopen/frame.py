"""CANopen frame."""

from __future__ import annotations

from typing import Any

import can


class Frame(can.Message):
    """A data frame with an 11-bit identifier, unchecked.

    Cheap to copy: the library's virtual bus copies every frame for every listener, and spends most
    of its time on that with its own frames.
    """

    __slots__ = ()

    def __init__(self, cob_id: int, data: bytes | bytearray) -> None:
        super().__init__(arbitration_id=cob_id, is_extended_id=False, data=bytearray(data))

    def __deepcopy__(self, memo: dict[int, Any] | None) -> Frame:
        twin = Frame(self.arbitration_id, self.data)
        twin.is_remote_frame = self.is_remote_frame
        return twin
