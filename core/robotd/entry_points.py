"""Entry points of what is installed: where robotd finds plugins, features and commands.

``importlib.metadata.entry_points`` reads a file of every distribution at each call, 12 ms with 150
of them; a start asks six times. What is installed later is found by the next process.
"""

from __future__ import annotations

import importlib.metadata
import sys
from functools import lru_cache
from importlib.metadata import EntryPoints
from typing import Any


def entry_points(*, group: str, name: str | None = None) -> EntryPoints:
    """Return the entry points of a group, or those of one name in it. Any thread."""
    selection = {"group": group} if name is None else {"group": group, "name": name}
    found: EntryPoints = _installed(tuple(sys.path)).select(**selection)
    return found


@lru_cache(maxsize=1)
def _installed(path: tuple[str, ...]) -> Any:  # SelectableGroups until Python 3.11
    """Read them all; ``path`` is what ``importlib.metadata`` searches."""
    del path
    return importlib.metadata.entry_points()
