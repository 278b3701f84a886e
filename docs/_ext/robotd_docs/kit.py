"""The ``conformance-checks`` directive: every check of the conformance kit, by theme."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

import robotd_conformance.checks
from robotd_docs.markdown import table

JOINTS = "joints"  # the fixture of checks that need joints
INJECTOR = "FaultInjector"  # the type of the fixture of checks that need one
USES_INJECTOR = re.compile(r"\.injector\b|harness\.trip\(")
MUTANTS = Path(__file__).parents[3] / "tests" / "conformance" / "mutants"
FOLDER = Path(robotd_conformance.checks.__file__).parent


class ChecksDirective(SphinxDirective):
    """Render one section per theme: the docstring of its module, then its checks."""

    def run(self) -> list[nodes.Node]:
        """Return headings, texts and tables."""
        themes = sorted(FOLDER.glob("test_*.py"))
        if not themes:
            raise self.error(f"no checks in {FOLDER}")
        text = "\n\n".join(_theme(path) for path in themes)
        if "joints |" not in text or "fault injector |" not in text:
            raise self.error("no check needs joints or a fault injector: names have changed")
        return self.parse_text_to_nodes(text, allow_section_headings=True)


class MutantsDirective(SphinxDirective):
    """Render the mutants of the kit by theme, each with the checks that find it."""

    def run(self) -> list[nodes.Node]:
        """Return headings and tables."""
        modules = sorted(MUTANTS.glob("*_mutants.py"))
        if not modules:
            raise self.error(f"no mutants in {MUTANTS}")
        text = "\n\n".join(_mutants(path) for path in modules)
        return self.parse_text_to_nodes(text, allow_section_headings=True)


def _mutants(path: Path) -> str:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    rows = [
        (re.sub(r"(?<=[a-z])(?=[A-Z])", " ", node.name).lower(), _found_by(node))
        for node in tree.body
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    ]
    return f"### {ast.get_docstring(tree)}\n\n{table(('mutant', 'found by'), rows)}"


def _found_by(mutant: ast.ClassDef) -> str:
    """Return the checks that a mutant names, without the names of their modules."""
    values = [
        ast.literal_eval(node.value)
        for node in mutant.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "found_by"
    ]
    names = [values[0]] if isinstance(values[0], str) else values[0]
    return (
        ", ".join(f"`{name.partition('::test_')[2]}`" for name in names if name) or "no check yet"
    )


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
    arguments = {each.arg: ast.unparse(each.annotation or each) for each in check.args.args}
    if JOINTS in arguments:
        needs.append("joints")
    if INJECTOR in arguments.values() or USES_INJECTOR.search(ast.unparse(check)):
        needs.append("fault injector")
    return ", ".join(needs)


def _is_mark(node: ast.stmt) -> bool:
    return isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "pytestmark"


def setup(app: Any) -> None:
    """Register the directive."""
    app.add_directive("conformance-checks", ChecksDirective)
    app.add_directive("conformance-mutants", MutantsDirective)
