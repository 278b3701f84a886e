"""Codes of WMX, EtherCAT and drives for ``robotd explain``, with remedies; without the SDK."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from importlib.resources import files

from robotd.api import CodeTable
from robotd_cia402.code_tables import drive_remedy
from robotd_wmx.al_status import TEXTS
from robotd_wmx.remedies import AL_REMEDIES, REMEDIES


def _rows() -> Iterator[tuple[int, str, str, str]]:
    """Yield code, name in the SDK, class and text of each error."""
    lines = (files("robotd_wmx") / "error_codes.tsv").read_text("utf-8").splitlines()
    for api, code, name, text in csv.reader(lines[1:], delimiter="\t"):
        yield int(code), name, api, text


def _texts() -> dict[int, str]:
    """Meaning of each code, with its name in the SDK and its class."""
    texts: dict[int, str] = {}
    for code, name, api, text in _rows():
        line = f"{name} ({api}): {text}"
        texts[code] = f"{texts[code]}; {line}" if code in texts else line
    return texts


def _remedies() -> dict[int, str]:
    return {code: REMEDIES[name] for code, name, _, _ in _rows() if code and name in REMEDIES}


_BY_CODE = _remedies()


def _remedy(code: int) -> str:
    return _BY_CODE.get(code, "")


def _al_remedy(code: int) -> str:
    return AL_REMEDIES.get(code, "")


DRIVE_ALARMS = CodeTable("drive alarm", {}, remedy=drive_remedy)
"""Remedies alone: the engine passes on the CiA 402 code of a drive, which other tables explain."""
WMX_ERRORS = CodeTable("WMX error", _texts(), digits=0, remedy=_remedy)
AL_STATUS = CodeTable("EtherCAT AL status", TEXTS, remedy=_al_remedy)
