"""Markdown tables and texts for generated pages."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table; columns that are empty in every row are left out."""
    lines = [list(row) for row in rows]
    used = [index for index in range(len(header)) if any(line[index] for line in lines)]
    cells = [[line[index].replace("|", "\\|") for index in used] for line in lines]
    head = [header[index] for index in used]
    return "\n".join(f"| {' | '.join(row)} |" for row in [head, ["---"] * len(used), *cells])


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
