"""The page of the conformance checks lists every check, with what it needs."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
from tests.conformance.kit import CHECKS

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "conformance.md"
NEEDS = {"injector": "an injector", "jointed": "joints"}


def rows(theme: Path) -> list[tuple[str, str]]:
    """Each check of a theme in words, and what it needs, as the page has them."""
    tree = ast.parse(theme.read_text(encoding="utf-8"))
    whole = [capability(node.value) for node in tree.body if is_mark(node)]
    found = []
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
            needs = [capability(mark) for mark in node.decorator_list if is_needs(mark)] or [*whole]
            source = ast.unparse(node)
            needs += [NEEDS[each.arg] for each in node.args.args if each.arg in NEEDS]
            if "FaultInjectorOrSkip" in source:
                needs.append("an injector")
            words = node.name.removeprefix("test_").replace("_", " ").replace("robotds", "robotd's")
            found.append((words, ", ".join(needs)))
    return found


def is_mark(node: ast.stmt) -> bool:
    return isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "pytestmark"


def is_needs(mark: ast.expr) -> bool:
    return ast.unparse(mark).startswith("pytest.mark.needs(")


def capability(mark: ast.expr) -> str:
    name = re.search(r"Capability\.(\w+)", ast.unparse(mark))
    assert name
    return f"`{name[1].lower()}`"


@pytest.mark.parametrize("theme", sorted(CHECKS.glob("test_*.py")), ids=lambda path: path.stem)
def test_every_check_is_in_the_table_of_its_theme(theme: Path) -> None:
    section = PAGE.read_text(encoding="utf-8").split(f"## {theme.stem}\n")[1].split("\n## ")[0]
    listed = [tuple(row) for row in re.findall(r"^\| (.+?) \| ?(.*?) ?\|$", section, re.MULTILINE)]
    assert listed[1:] == rows(theme)
