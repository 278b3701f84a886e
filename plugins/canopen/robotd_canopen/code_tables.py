"""Codes of CANopen for ``robotd explain``: aborts of SDO transfers."""

from __future__ import annotations

from canopen.sdo.exceptions import SdoAbortedError

from robotd.api import CodeTable

_SDO_REMEDIES = {
    0x0504: "Check power, cable and id of the node; SDO transfers of two masters collide",
    0x0601: "Read the access of the object in the EDS of the drive",
    0x0602: "Compare the object with the EDS of the drive: another firmware may not have it",
    0x0604: "Compare the PDO mapping with what the drive allows",
    0x0606: "Switch the drive off and on; if it stays, replace the drive",
    0x0607: "Compare the size of the object with the EDS of the drive",
    0x0609: "Compare subindex and value with the limits in the EDS of the drive",
    0x0800: "Bring the drive into a state in which the object may be written: at rest, servo off",
}
"""By the upper half of the code."""


def sdo_remedy(code: int) -> str:
    """Return what to do about an abort code; "" where it is not known."""
    return _SDO_REMEDIES.get(code >> 16, "")


SDO_ABORTS = CodeTable(
    "CANopen SDO abort",
    {code: text[0].lower() + text[1:] for code, text in SdoAbortedError.CODES.items()},
    digits=8,
    remedy=sdo_remedy,
)
