"""AL status codes for ``robotd explain``."""

from __future__ import annotations

from robotd.api import CodeTable
from robotd_ethercat.al_status import AL_STATUS_CODES


def _remedy(code: int) -> str:
    return AL_STATUS_CODES.get(code, ("", ""))[1]


AL_STATUS = CodeTable(
    "EtherCAT AL status",
    {code: meaning for code, (meaning, _) in AL_STATUS_CODES.items() if code},
    remedy=_remedy,
)
