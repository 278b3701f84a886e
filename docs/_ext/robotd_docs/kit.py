"""The ``conformance-checks`` directive: every check of the conformance kit, by theme."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

import robotd.testing.conformance
from robotd_docs.markdown import table

FOLDER = Path(robotd.testing.conformance.__file__).parent


class ChecksDirective(SphinxDirective):
    """Render one section per theme: the docstring of its module, then its checks."""

    def run(self) -> list[nodes.Node]:
        """Return headings, texts and tables."""
        themes = sorted(FOLDER.glob("test_*.py"))
        if not themes:
            raise self.error(f"no checks in {FOLDER}")
        text = "\n\n".join(_theme(path) for path in themes)
        return self.parse_text_to_nodes(text, allow_section_headings=True)


def _theme(path: Path) -> str:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    rows = [
        (f"`{node.name.removeprefix('test_')}`", _needs(node, tree))
        for node in tree.body
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
    ]
    return f"## {path.stem}\n\n{ast.get_docstring(tree)}\n\n{table(('check', 'needs'), rows)}"


def _needs(check: ast.FunctionDef, tree: ast.Module) -> str:
    """Return what has to be there for a check to run: capabilities, joints, a fault injector."""
    marks = [ast.unparse(mark) for mark in check.decorator_list]
    whole = [ast.unparse(node.value) for node in tree.body if _is_mark(node)]
    marks = [mark for mark in marks if "mark.needs(" in mark] or whole
    capabilities = re.findall(r"Capability\.(\w+)", " ".join(marks))
    needs = [f"`{name.lower()}`" for name in capabilities]
    arguments = {argument.arg for argument in check.args.args}
    if "jointed" in arguments:
        needs.append("joints")
    if arguments & {"bench", "fault_injector"} or re.search(
        r"BenchOrSkip|FaultInjectorOrSkip", ast.unparse(check)
    ):
        needs.append("fault injector")
    return ", ".join(needs)


def _is_mark(node: ast.stmt) -> bool:
    return isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "pytestmark"


def setup(app: Any) -> None:
    """Register the directive."""
    app.add_directive("conformance-checks", ChecksDirective)
