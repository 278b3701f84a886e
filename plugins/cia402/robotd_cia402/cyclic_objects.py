"""Objects of one drive axis on a fieldbus: the protocol that a backend implements."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Protocol

from robotd.api import OperationError
from robotd_cia402.emcy import Emergency


class SdoAbort(OperationError):
    """SDO transfer aborted by the node; ``code`` is the code of CiA 301."""

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code


class CyclicObjects(Protocol):
    """Objects of one axis: values in the cyclic frames, SDO transfers and emergencies.

    ``index`` is the number of an object in the profile, such as 0x6041, without the offset of a
    multi-axis drive. Values are integers in the drive's units, signed if the object's type is.
    The time of received values is not part of it: the backend dates the whole process image.
    """

    @property
    def name(self) -> str:
        """Name of the node that begins error texts, ``node 2``."""

    @property
    def online(self) -> bool:
        """True for a node that is configured and has not been lost since. Any thread."""

    @property
    def fault(self) -> str:
        """Cause of the loss of the node; "" while it is online. Any thread."""

    @property
    def known(self) -> bool:
        """True for an online node whose cyclic inputs have all come since it was configured.

        Control loop.
        """

    @property
    def awaited(self) -> str:
        """Cyclic inputs that a node which is online but not ``known`` has not sent yet.

        Control loop.
        """

    @property
    def frames(self) -> int:
        """Cyclic frames sent so far; a value may be one frame old. Any thread."""

    @property
    def emergency(self) -> Emergency | None:
        """Emergency in force; None without one. Any thread."""

    @property
    def inputs(self) -> Collection[int]:
        """Objects in the cyclic frames from the drive, once it is configured."""

    @property
    def outputs(self) -> Collection[int]:
        """Objects in the cyclic frames to the drive, once it is configured."""

    def put(self, values: Sequence[int]) -> None:
        """Set the outputs for the next cyclic frame, and those after it. Control loop.

        Args:
            values: of the objects in ``OUTPUTS``; those that the frames do not hold are ignored.
        """

    def values(self) -> Sequence[int]:
        """Return the inputs taken last, in the order of ``INPUTS``. Control loop.

        0 before an object has come, and for one that the frames do not hold.
        """

    def writable(self, index: int, sub: int) -> bool:
        """Return False for an object that is missing or read-only. Worker."""

    def read(self, index: int, sub: int = 0) -> int:
        """Read an object by SDO. Worker. Raises SdoAbort, DeviceTimeout, OperationError."""

    def write(self, index: int, sub: int, value: int) -> None:
        """Write an object by SDO. Worker. Raises SdoAbort, DeviceTimeout, OperationError."""

    def forget(self) -> None:
        """Discard the inputs: the drive has been configured anew. Worker."""
