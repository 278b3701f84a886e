"""Error codes of WMX and EtherCAT for ``robotd explain``; without the SDK."""

from __future__ import annotations

import csv
from importlib.resources import files

from robotd.api import CodeTable
from robotd_wmx.al_status import TEXTS


def _texts() -> dict[int, str]:
    """Meaning of each code, with its name in the SDK and its class."""
    lines = (files("robotd_wmx") / "error_codes.tsv").read_text("utf-8").splitlines()
    texts: dict[int, str] = {}
    for api, code, name, text in csv.reader(lines[1:], delimiter="\t"):
        line = f"{name} ({api}): {text}"
        texts[int(code)] = f"{texts[int(code)]}; {line}" if int(code) in texts else line
    return texts


WMX_ERRORS = CodeTable("WMX error", _texts(), digits=0)
AL_STATUS = CodeTable("EtherCAT AL status", TEXTS)
