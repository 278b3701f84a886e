"""Numbers in error texts: enough digits that a value and its limit differ."""

from __future__ import annotations

_MAX_DIGITS = 17  # distinguish any two doubles


def distinct(value: float, limit: float, digits: int = 5) -> tuple[str, str]:
    """Format two numbers with ``digits`` significant digits, or more until the texts differ.

    Equal numbers keep ``digits``; 0 has no sign. NaN and inf are written as such.
    """
    value, limit = value + 0.0, limit + 0.0  # of -0.0 that is 0.0
    texts = f"{value:.{digits}g}", f"{limit:.{digits}g}"
    more = range(digits + 1, _MAX_DIGITS + 1) if value != limit else ()
    for count in more:
        if texts[0] != texts[1]:
            break
        texts = f"{value:.{count}g}", f"{limit:.{count}g}"
    return texts
