"""Markdown tables and texts for generated pages."""

from __future__ import annotations

import re
from collections.abc import Iterable


def code(text: object) -> str:
    """Return ``text`` as inline code; an empty text stays empty."""
    return f"`{text}`" if str(text) else ""


def definitions(lines: Iterable[str]) -> dict[str, str]:
    """Read a Markdown definition list: a line with the `term`, then ``: text``, indented on."""
    found: dict[str, str] = {}
    term = ""
    for line in lines:
        if match := re.fullmatch(r"`([^`]+)`", line.strip()):
            term = match[1]
            found[term] = ""
        elif line.strip():
            found[term] = f"{found[term]} {line.strip().removeprefix(': ')}".strip()
    return found
