"""Import packages without their optional parts, which cost start-up time and memory."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def missing(*names: str) -> Iterator[None]:
    """Make imports of the modules ``names`` fail with ImportError inside the block.

    For packages that do without them, at start-up only: other threads are affected too. Modules
    that are imported already stay, and afterwards all can be imported as ever.
    """
    hidden = [name for name in names if name not in sys.modules]
    for name in hidden:
        sys.modules[name] = None  # type: ignore[assignment]  # as documented for ``import``
    try:
        yield
    finally:
        for name in hidden:
            del sys.modules[name]
