"""Names and files of the walks in docs/explanation/data-path.md: they exist."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROOTS = (ROOT / "core/robotd", ROOT / "ros/robotd_ros", ROOT / "plugins")
PAGE = (ROOT / "docs/explanation/data-path.md").read_text(encoding="utf-8")
HOPS = dict.fromkeys(re.findall(r"([A-Za-z_][\w.]*) +([\w/]+\.py)$", PAGE, re.MULTILINE))


def test_the_page_has_hops() -> None:
    assert len(HOPS) > 30


@pytest.mark.parametrize(("name", "file"), HOPS)
def test_a_hop_is_in_its_file(name: str, file: str) -> None:
    [path] = [root / file for root in ROOTS if (root / file).is_file()]
    body = ast.parse(path.read_text(encoding="utf-8")).body
    for part in name.split("."):
        found = [
            node
            for node in body
            if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name == part
        ]
        assert found, f"{file} has no {name}"
        body = found[0].body
