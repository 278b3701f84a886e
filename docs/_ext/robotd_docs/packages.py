"""Directives ``package-sizes`` and ``package-imports``: a table of sizes, a picture of imports.

Both are made from the packages in ``pyproject.toml`` and their sources, when the site is built.
"""

from __future__ import annotations

import ast
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

from robotd_doctor.model_tables import table

ROOT = Path(__file__).parents[3]
LIBRARIES = {
    "robotd_cia402",
    "robotd_messages",
    "robotd_recording",
    "robotd_servo_model",
    "robotd_shared",
    "robotd_wmx_parameters",
}
CORE = "robotd"
ROWS = ("features", "ros", "plugins", "libraries", "core")
WIDTH, ROW_HEIGHT, BOX_HEIGHT = 1000, 96, 34


@cache
def packages() -> dict[str, str]:
    """Return the folder of each package."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    folders: dict[str, str] = project["tool"]["setuptools"]["package-dir"]
    return {name: folder for name, folder in folders.items() if name != "robotd_robots"}


def sources(package: str) -> list[Path]:
    """Return the modules of a package."""
    return sorted((ROOT / packages()[package]).rglob("*.py"))


def imported_packages(package: str) -> set[str]:
    """Return the packages of this repository that ``package`` imports."""
    found = set()
    for path in sources(package):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                found.add(node.module.partition(".")[0])
            elif isinstance(node, ast.Import):
                found |= {alias.name.partition(".")[0] for alias in node.names}
    return (found & packages().keys()) - {package}


def row_of(package: str) -> str:
    """Return the row of the picture in which a package is drawn."""
    if package == CORE:
        return "core"
    if package in LIBRARIES:
        return "libraries"
    return packages()[package].partition("/")[0]


def draw() -> str:
    """Return the picture as SVG: an arrow for each package that imports another one."""
    rows: dict[str, list[str]] = defaultdict(list)
    for package in packages():
        rows[row_of(package)].append(package)
    boxes: dict[str, tuple[float, float, float]] = {}  # centre, top, width
    for number, row in enumerate(ROWS):
        step = WIDTH / len(rows[row])
        for place, package in enumerate(rows[row]):
            boxes[package] = ((place + 0.5) * step, 10.0 + number * ROW_HEIGHT, min(step - 8, 180))
    parts = [*_arrows(boxes), *_boxes(boxes)]
    height = len(ROWS) * ROW_HEIGHT
    return (
        f'<svg viewBox="0 0 {WIDTH} {height}" role="img" aria-label="Imports between packages"'
        ' style="width:100%;font:11px sans-serif">'
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="6"'
        ' markerHeight="6" orient="auto"><path d="M0 0L8 4L0 8z" fill="currentColor"/></marker>'
        f"</defs>{''.join(parts)}</svg>"
    )


def _arrows(boxes: dict[str, tuple[float, float, float]]) -> Iterator[str]:
    for package, (centre, top, _) in boxes.items():
        for other in sorted(imported_packages(package) & boxes.keys()):
            x, y, _ = boxes[other]
            weight = "0.25" if other == CORE else "0.8"  # all import the core
            yield (
                f'<line x1="{centre:.0f}" y1="{top + BOX_HEIGHT:.0f}" x2="{x:.0f}" y2="{y:.0f}"'
                f' stroke="currentColor" stroke-opacity="{weight}" marker-end="url(#tip)"/>'
            )


def _boxes(boxes: dict[str, tuple[float, float, float]]) -> Iterator[str]:
    for package, (centre, top, width) in boxes.items():
        label = package.removeprefix("robotd_")
        yield (
            f'<rect x="{centre - width / 2:.0f}" y="{top:.0f}" width="{width:.0f}"'
            f' height="{BOX_HEIGHT}" rx="4" fill="var(--color-background-secondary, #eee)"'
            ' stroke="currentColor"/>'
            f'<text x="{centre:.0f}" y="{top + 21:.0f}" text-anchor="middle"'
            f' fill="currentColor">{label}</text>'
        )


class ImportsDirective(SphinxDirective):
    """Draw the imports between the packages."""

    def run(self) -> list[nodes.Node]:
        """Return the picture."""
        return [nodes.raw("", draw(), format="html")]


class SizesDirective(SphinxDirective):
    """List files and lines of each package."""

    def run(self) -> list[nodes.Node]:
        """Return the table."""
        rows = []
        for package, folder in sorted(packages().items(), key=lambda item: item[1]):
            files = sources(package)
            lines = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files)
            rows.append((f"`{folder}`", str(len(files)), f"{lines:,}"))
        return self.parse_text_to_nodes(table(("package", "files", "lines"), rows))


def setup(app: Any) -> None:
    """Register the directives."""
    app.add_directive("package-imports", ImportsDirective)
    app.add_directive("package-sizes", SizesDirective)
