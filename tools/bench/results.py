"""Folder for the results of long runs: ``--out``, by default in the docs."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import click

BEGIN, END = "<!-- figures: begin -->", "<!-- figures: end -->"
OUT = Path(__file__).parents[2] / "docs" / "reference" / "benchmarks"

out_option = click.option(
    "--out", default=OUT, type=click.Path(path_type=Path), help="Folder of the results."
)


def keep(out: Path, name: str, content: dict[str, Any]) -> None:
    """``content`` as ``name``.json in ``out``, which is made when it is not there."""
    out.mkdir(parents=True, exist_ok=True)
    text = json.dumps(content, indent=1) + "\n"
    (out / f"{name}.json").write_text(text, encoding="utf-8")


def told(facts: Mapping[str, Any]) -> str:
    """Say what was measured where, from the facts that ``machine`` returns."""
    return (
        f"{facts['cpu']}, {facts['cores']} cores, Linux {facts['kernel']}, Python"
        f" {facts['python']}, commit {facts['commit']}, load before {facts['load_before']:.2f}"
        f"{told_costs(facts)}"
    )


def told_costs(facts: Mapping[str, Any]) -> str:
    """Say what every program pays here, from what ``computer`` returns; "" without it."""
    if "memory_ns" not in facts:
        return ""
    return (
        f"; a wake-up takes {facts['wake_up_us']:.0f} µs and is {facts['wake_up_late_us']:.0f} µs"
        f" late, a load from memory {facts['memory_ns']:.0f} ns"
    )


def into_page(page: Path, report: str) -> None:
    """Replace the figures of ``page``, which stand between two comments, where it is there."""
    if page.exists():
        before, _, rest = page.read_text(encoding="utf-8").partition(BEGIN)
        after = rest.partition(END)[2]
        page.write_text(f"{before}{BEGIN}\n{report}\n{END}{after}", encoding="utf-8")


def table(columns: Mapping[str, tuple[str, str]], runs: Iterable[Mapping[str, Any]]) -> str:
    """Return a table of Markdown: heading → key in each of ``runs``, and how it is written."""
    lines = [f"| {' | '.join(columns)} |", "|" + "---:|" * len(columns)]
    for run in runs:
        cells = (form.format(run[key]) for key, form in columns.values())
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)
