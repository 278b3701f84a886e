"""Links of the pages outside the site lead to files; Sphinx checks those inside."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [*ROOT.glob("*.md"), ROOT / "robots" / "README.md", *(ROOT / ".github").rglob("*.md")]


def links(page: Path) -> list[str]:
    """The targets of all links to files, without anchors."""
    found = re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8"))
    return [target.partition("#")[0] for target in found if not target.startswith(("http", "#"))]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_leads_to_a_file(page: Path) -> None:
    for target in links(page):
        assert (page.parent / target).exists(), target


def test_no_page_has_markers_of_an_unresolved_merge() -> None:
    pages = [*PAGES, *(ROOT / "docs").rglob("*.md")]
    marker = re.compile(r"(<{7}|>{7}) [0-9A-Za-z]")
    assert [page for page in pages if marker.search(page.read_text(encoding="utf-8"))] == []


def test_decisions_have_numbers_of_their_own() -> None:
    pages = sorted((ROOT / "docs" / "decisions").glob("0*.md"))
    numbers = [page.name.partition("-")[0] for page in pages]
    assert len(numbers) == len(set(numbers)), numbers
    for number, page in zip(numbers, pages, strict=True):
        title = page.read_text(encoding="utf-8").partition("\n")[0]
        assert re.match(rf"# 0*{int(number)}[.:] ", title), title
