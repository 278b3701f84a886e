"""The ``conformance-checks`` directive: every check of the conformance kit, by theme."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

import robotd_conformance.checks
from robotd_conformance.checks import aspects
from robotd_conformance.checks.clauses import Clause, load
from robotd_doctor.model_tables import table

JOINTS = "joints"  # the fixture of checks that need joints
INJECTOR = "FaultInjector"  # the type of the fixture of checks that need one
USES_INJECTOR = re.compile(r"\.injector\b|harness\.trip\(")
MUTANTS = Path(__file__).parents[3] / "tests" / "features" / "conformance" / "runs" / "mutants"
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


class ClausesDirective(SphinxDirective):
    """Render the matrix: each clause of the driver contract, its faults, and what finds them."""

    def run(self) -> list[nodes.Node]:
        """Return a sentence, then headings and tables by member of the contract."""
        clauses, _, _ = load()
        mutants = [
            mutant for path in sorted(MUTANTS.glob("*_mutants.py")) for mutant in _mutants(path)
        ]
        if not mutants:
            raise self.error(f"no mutants in {MUTANTS}")
        cells = [(clause.id, fault) for clause in clauses.values() for fault in clause.faults]
        filled = {(clause, fault) for clause, fault, _, found_by in mutants if found_by}
        bearing = _bearing()
        summary = (
            f"{len(clauses)} clauses have {len(cells)} cells, a clause and a fault that makes sense"
            f" for it. {len(filled & set(cells))} have a mutant that a check finds; {len(mutants)}"
            " mutants in all."
        )
        parts = [summary]
        for member in dict.fromkeys(clause.member for clause in clauses.values()):
            rows = [
                row
                for clause in clauses.values()
                if clause.member == member
                for row in _clause_rows(clause, mutants, bearing)
            ]
            header = ("clause", "fault", "mutants", "found by")
            parts.append(f"### {member}\n\n{table(header, rows)}")
        return self.parse_text_to_nodes("\n\n".join(parts), allow_section_headings=True)


class AspectsDirective(SphinxDirective):
    """Render the matrix of clauses and aspects, after the reasons of cells without a check."""

    def run(self) -> list[nodes.Node]:
        """Return a sentence and two tables."""
        names, reasons = aspects.load()
        themes = {
            node.name: path.name
            for path in FOLDER.glob("test_*.py")
            for node in ast.parse(path.read_text(encoding="utf-8")).body
            if isinstance(node, ast.FunctionDef)
        }

        def whole(checks: Iterable[str]) -> list[str]:
            return [f"{themes[f'test_{name}']}::test_{name}" for name in checks]

        mutants = [
            mutant for path in sorted(MUTANTS.glob("*_mutants.py")) for mutant in _mutants(path)
        ]
        found = [(clause, fault, whole(checks)) for clause, fault, _, checks in mutants]
        bearing = {clause: whole(checks) for clause, checks in _bearing().items()}
        rows = aspects.cells(found, bearing)
        cells = [cell for row in rows.values() for cell in row.values()]
        checked, still_open = sum(map(str.isdigit, cells)), cells.count(aspects.OPEN)
        summary = (
            f"Of {len(cells)} cells {checked} have checks (their number),"
            f" {len(cells) - checked - still_open} a reason why there is none (its letter), and"
            f" {still_open} are open (·)."
        )
        body = [
            (f"`{clause}`", *("·" if cell == aspects.OPEN else cell for cell in row.values()))
            for clause, row in rows.items()
        ]
        parts = [
            summary,
            table(("letter", "why there is no check"), sorted(reasons.items())),
            table(("clause", *names), body),
        ]
        return self.parse_text_to_nodes("\n\n".join(parts), allow_section_headings=True)


NAMES = ("breaks", "found_by")
Cell = tuple[str, str, str, tuple[str, ...]]


def _clause_rows(
    clause: Clause, mutants: list[Cell], bearing: dict[str, list[str]]
) -> Iterator[tuple[str, ...]]:
    """Yield the text of a clause with its checks, then a row for each fault."""
    checks = ", ".join(f"`{name}`" for name in bearing.get(clause.id, ()))
    yield f"`{clause.id.partition('/')[2]}`", f"*{clause.says}*", "", checks or "no check"
    for fault in clause.faults:
        own = [mutant for mutant in mutants if mutant[:2] == (clause.id, fault)]
        names = ", ".join(_words(name) for _, _, name, _ in own)
        found = dict.fromkeys(check for *_, checks in own for check in checks)
        yield "", fault, names or "—", ", ".join(f"`{name}`" for name in found) or "—"


def _mutants(path: Path) -> Iterator[Cell]:
    """Yield clause, fault, name and finding checks of each mutant of a module."""
    body = ast.parse(path.read_text(encoding="utf-8")).body
    constants = _assigned(body, {})
    for node in body:
        if not isinstance(node, ast.ClassDef) or node.name.startswith("_"):
            continue
        values = _assigned(node.body, constants)
        if "breaks" not in values:  # a part of several mutants
            continue
        checks = values.get("found_by") or ""
        names = [checks] if isinstance(checks, str) else checks
        found_by = tuple(name.partition("::test_")[2] for name in names if name)
        yield *values["breaks"], node.name, found_by


def _assigned(body: list[ast.stmt], constants: dict[str, Any]) -> dict[str, Any]:
    """Return the texts, and tuples of texts, that statements give to names."""

    def value(node: ast.expr) -> Any:
        if isinstance(node, ast.Name):
            return constants.get(node.id)
        if isinstance(node, ast.Tuple):
            return tuple(map(value, node.elts))
        return node.value if isinstance(node, ast.Constant) else None

    return {
        statement.targets[0].id: value(statement.value)
        for statement in body
        if isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name)
    }


def _bearing() -> dict[str, list[str]]:
    """Return the checks that bear each clause, by the marker ``clause``."""
    found: dict[str, list[str]] = {}
    for path in sorted(FOLDER.glob("test_*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if not isinstance(node, ast.FunctionDef):
                continue
            marks = [
                decorator
                for decorator in node.decorator_list
                if "mark.clause" in ast.unparse(decorator)
            ]
            for name in (ast.literal_eval(arg) for mark in marks for arg in mark.args):  # type: ignore[attr-defined]
                found.setdefault(name, []).append(node.name.removeprefix("test_"))
    return found


def _words(name: str) -> str:
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()


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
    arguments = {
        argument.arg: ast.unparse(argument.annotation or argument) for argument in check.args.args
    }
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
    app.add_directive("conformance-clauses", ClausesDirective)
    app.add_directive("conformance-aspects", AspectsDirective)
