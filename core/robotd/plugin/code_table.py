"""Tables of alarm, error and abort codes, offered by plugins for ``robotd explain CODE``.

A table is an entry point of the group ``robotd.codes`` that leads to a ``CodeTable``. It is
imported for that command and the live page, so it must not need hardware or a device library.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from pydantic.dataclasses import dataclass

from robotd.entry_points import PluginOrigin, installed_names, load_entry
from robotd.errors import PluginError

GROUP = "robotd.codes"


@dataclass(frozen=True, config={"extra": "forbid"})
class CodeTable:
    """Codes of one kind, such as the emergency codes of CANopen.

    Attributes:
        title: kind of the codes, for people: ``CANopen emergency``.
        texts: meaning of each known code, one line.
        digits: hexadecimal digits of a code; 0: they are written in decimal.
        other: meaning of a code that is not in ``texts``, such as the class that it belongs to,
            "" for none; None: there are no others.
        remedy: what to do about a code, "" where it is not known; None: it never is.
    """

    title: str
    texts: Mapping[int, str]
    digits: int = 4
    other: Callable[[int], str] | None = None
    remedy: Callable[[int], str] | None = None

    def line(self, code: int) -> str:
        """Return ``CANopen emergency 0x8611: following error``; "" for a code of another kind."""
        text = self.texts.get(code) or (self.other(code) if self.other else "")
        number = f"0x{code:0{self.digits}X}" if self.digits and code >= 0 else str(code)
        return f"{self.title} {number}: {text}" if text else ""

    def advice(self, code: int) -> str:
        """Return what to do about a code; "" where it is not known."""
        return self.remedy(code) if self.remedy else ""


def load_code_tables(package: str = "") -> tuple[list[CodeTable], dict[PluginOrigin, str]]:
    """Return the tables of all plugins, and why others failed.

    ``package``: only those of this top-level package; "": all.
    """
    names = installed_names(GROUP)
    tables, failures = [], {} if package else dict(names.refused)
    for origin, entry in names.entries.values():
        if package and entry.module.partition(".")[0] != package:
            continue
        try:
            table = load_entry(origin, entry)
            if not isinstance(table, CodeTable):
                what = f"must be a CodeTable, is {type(table).__name__}"
                raise PluginError(f"code table {origin}: {what}")  # noqa: TRY301
            tables.append(table)
        except PluginError as error:
            failures[origin] = str(error)
    return tables, failures
