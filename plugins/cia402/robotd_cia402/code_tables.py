"""Error codes of CiA 402 drives for ``robotd explain``."""

from __future__ import annotations

from robotd.api import CodeTable, drive_remedy
from robotd_cia402.emcy import class_text, known_texts

EMERGENCIES = CodeTable(
    "CANopen emergency, CiA 402 error code",
    known_texts(),
    other=class_text,
    remedy=drive_remedy,
)
