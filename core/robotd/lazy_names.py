"""Names that a module imports when they are first read, so that importing it costs nothing."""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable, Iterator
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any


def lazy_names(module: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return ``__getattr__`` and ``__dir__`` of a module with its imports below TYPE_CHECKING.

    Type checkers, linters and readers see ordinary imports; there is no second list of them::

        if TYPE_CHECKING:
            from robotd.arrays import FloatArray
        else:
            __getattr__, __dir__ = lazy_names(__name__)
    """

    @cache
    def origins() -> dict[str, tuple[str, str]]:
        source = Path(str(sys.modules[module].__file__)).read_text(encoding="utf-8")
        return dict(_imports(ast.parse(source)))

    def read(name: str) -> Any:
        # Python asks every module for names such as __path__ and __wrapped__.
        if name.startswith("__") or name not in origins():
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        origin, original = origins()[name]
        value = getattr(import_module(origin), original)
        setattr(sys.modules[module], name, value)  # the next read does not come here
        return value

    return read, lambda: sorted({*vars(sys.modules[module]), *origins()})


def _imports(tree: ast.Module) -> Iterator[tuple[str, tuple[str, str]]]:
    """Yield each name imported below TYPE_CHECKING, with its module and its name there."""
    for block in tree.body:
        if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING":
            for statement in block.body:
                if isinstance(statement, ast.ImportFrom) and statement.module:
                    for alias in statement.names:
                        yield alias.asname or alias.name, (statement.module, alias.name)
