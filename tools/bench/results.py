"""Folder for the results of long runs: ``--out``, by default in the docs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

OUT = Path(__file__).parents[2] / "docs" / "reference" / "benchmarks"

out_option = click.option(
    "--out", default=OUT, type=click.Path(path_type=Path), help="Folder of the results."
)


def keep(out: Path, name: str, content: dict[str, Any]) -> None:
    """``content`` as ``name``.json in ``out``, which is made when it is not there."""
    out.mkdir(parents=True, exist_ok=True)
    text = json.dumps(content, indent=1) + "\n"
    (out / f"{name}.json").write_text(text, encoding="utf-8")
