"""``python -m tools.module_map``: write ``docs/reference/modules.md``, the map of all modules.

Each line is the head of a file: the first line of its docstring, or of its comment. ``make lint``
fails where the page differs from them (``--check``).
"""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterable, Iterator
from itertools import groupby
from pathlib import Path, PurePath

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs/reference/modules.md"
FOLDERS = ("core", "ros", "features", "plugins", "tools")
SUFFIXES = frozenset({".py", ".ts", ".cpp", ".hpp"})
LEFT_OUT = ("/tests/", "/templates/", "__main__.py")
HEAD = """# Modules

Every module and the first line of its docstring, folder by folder, for a search in this page. For
what several modules decide, see the tables of [Contributing](../contributing.md#layout) and the
walks of [Data path](../explanation/data-path.md). `python -m tools.module_map` writes this page.
"""


def head_of(path: PurePath, text: str) -> str:
    """Return the first line of a module's docstring or leading comment; "" without one."""
    if path.suffix == ".py":
        text = ast.get_docstring(ast.parse(text)) or ""
    elif not text.startswith("//"):
        return ""
    return text.partition("\n")[0].removeprefix("//").strip().replace("``", "`")


def page(modules: Iterable[tuple[PurePath, str]]) -> Iterator[str]:
    """Yield the lines of the page; ``modules``: paths and texts, in any order."""
    heads = [(path, head_of(path, text)) for path, text in modules]
    heads.sort(key=lambda module: (module[0].parent, module[0].name))
    yield HEAD
    for folder, files in groupby(heads, key=lambda module: module[0].parent):
        named = [*files]
        yield f"## {folder}\n"
        yield from (f"{head}\n" for path, head in named if path.name == "__init__.py" and head)
        for path, head in named:
            if path.name != "__init__.py":
                yield f"- `{path.name}`: {head}" if head else f"- `{path.name}`"
        yield ""


def main() -> None:
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "--", *FOLDERS]
    listed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    paths = [
        PurePath(path)
        for path in listed.splitlines()
        if PurePath(path).suffix in SUFFIXES and not any(part in path for part in LEFT_OUT)
    ]
    modules = [(path, (ROOT / path).read_text("utf-8")) for path in paths if (ROOT / path).exists()]
    text = "\n".join(page(modules)).rstrip() + "\n"
    if "--check" not in sys.argv[1:]:
        PAGE.write_text(text, encoding="utf-8")
    elif not PAGE.exists() or PAGE.read_text("utf-8") != text:
        sys.exit(f"{PAGE.relative_to(ROOT)} is out of date: python -m tools.module_map")


if __name__ == "__main__":
    main()
