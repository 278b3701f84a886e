"""Rules of language that a program can check; docs/reference/glossary.md has the terms."""

from __future__ import annotations

import ast
import re
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PACKAGES = {
    name: ROOT / folder
    for name, folder in {
        **PROJECT["tool"]["setuptools"]["package-dir"],
        "lerobot_robot_robotd": "features/learning/lerobot_robot_robotd/lerobot_robot_robotd",
        "robotd_wmx": "plugins/wmx/robotd_wmx",
    }.items()
}
BACKENDS = ("plugins/canopen", "plugins/cia402", "plugins/ethercat", "plugins/wmx")
FOLDERS = ("tests", "tools", "examples", "docs/_ext", *BACKENDS)
OLD_WORD = "refu" + "sed"  # "rejected" in the glossary
NO_ACTOR = re.compile(
    r"\b(some|any|no|every)body\b|\b(some|any|every)one\b|\bwhoever\b", re.IGNORECASE
)
MAX_WORDS = 15
NOUN_CLAUSES = ("What", "Where", "Who", "Whoever", "Whether", "How", "Why", "Which")
SHARED_NAMES = {"__init__", "__main__", "conftest"}

Named = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def modules(package: Path) -> list[Path]:
    skipped = {"templates", "build"}
    return sorted(path for path in package.rglob("*.py") if not skipped.intersection(path.parts))


def docstrings(path: Path) -> Iterator[tuple[int, str]]:
    """Line and first line of every docstring of a module."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, Named) and (text := ast.get_docstring(node)):
            line = getattr(node, "lineno", 1)
            yield line, text.splitlines()[0]


@pytest.mark.parametrize("package", PACKAGES)
def test_a_docstring_opens_with_a_short_statement(package: str) -> None:
    problems = []
    for path in modules(PACKAGES[package]):
        for line, text in docstrings(path):
            words = text.split()
            if len(words) > MAX_WORDS:
                problems.append(f"{path.relative_to(ROOT)}:{line}: {len(words)} words: {text}")
            if words[0] in NOUN_CLAUSES:
                problems.append(f"{path.relative_to(ROOT)}:{line}: opens with {words[0]}: {text}")
    assert not problems, "\n".join(problems)


@pytest.mark.parametrize("folder", FOLDERS)
def test_a_docstring_of_tests_and_tools_is_no_noun_clause(folder: str) -> None:
    problems = [
        f"{path.relative_to(ROOT)}:{line}: opens with {text.split()[0]}: {text}"
        for path in modules(ROOT / folder)
        for line, text in docstrings(path)
        if text.split()[0] in NOUN_CLAUSES
    ]
    assert not problems, "\n".join(problems)


def test_one_word_is_used_for_a_rejection() -> None:
    folders = [*PACKAGES.values(), *(ROOT / folder for folder in FOLDERS)]
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for folder in folders
        for path in modules(folder)
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if OLD_WORD in line
    ]
    assert not found, "\n".join(found)


def test_an_actor_is_named() -> None:
    pages = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("robots/**/*.md")]
    paths = [*pages, *(path for package in PACKAGES.values() for path in modules(package))]
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in paths
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if NO_ACTOR.search(line)
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize("package", PACKAGES)
def test_a_module_name_is_unique_in_its_package(package: str) -> None:
    places = defaultdict(list)
    for path in modules(PACKAGES[package]):
        if path.stem not in SHARED_NAMES:
            places[path.stem].append(str(path.relative_to(ROOT)))
    assert not {name: found for name, found in places.items() if len(found) > 1}


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_has_a_docstring(package: str) -> None:
    missing = []
    for path in modules(PACKAGES[package]):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in [tree, *tree.body]:
            name = getattr(node, "name", path.stem)
            is_public = isinstance(node, Named) and not name.startswith(("_", "test_"))
            if "conformance" in path.parts and path.stem.startswith("test_"):
                is_public = False  # helpers of the checks, private to their module
            if is_public and not ast.get_docstring(node):
                missing.append(f"{path.relative_to(ROOT)}: {name}")
    assert not missing, "\n".join(missing)
