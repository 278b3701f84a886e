"""Codes of CANopen for ``robotd explain``: emergencies and aborts of SDO transfers."""

from __future__ import annotations

from canopen.sdo.exceptions import SdoAbortedError

from robotd.api import CodeTable
from robotd_canopen.emcy import class_text, known_texts

EMERGENCIES = CodeTable("CANopen emergency, CiA 402 error code", known_texts(), other=class_text)
SDO_ABORTS = CodeTable(
    "CANopen SDO abort",
    {code: text[0].lower() + text[1:] for code, text in SdoAbortedError.CODES.items()},
    digits=8,
)
