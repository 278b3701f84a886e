"""Sphinx directives that generate the reference pages of robotd from its code."""

from __future__ import annotations

from typing import Any

from robotd_docs import commands, descriptor, exports, fixtures, kit, packages, surface


def setup(app: Any) -> dict[str, Any]:
    """Register the directives of all modules."""
    for module in (commands, descriptor, exports, fixtures, kit, packages, surface):
        module.setup(app)
    return {"parallel_read_safe": False, "parallel_write_safe": True}
