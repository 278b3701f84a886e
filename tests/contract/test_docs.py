"""Links of the pages outside the site lead to files; Sphinx checks those inside."""

from __future__ import annotations

import itertools
import re
import shlex
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EVERY_PAGE = [
    *ROOT.glob("*.md"),
    *(
        page
        for folder in ("docs", "examples", "features")
        for page in (ROOT / folder).rglob("*.md")
    ),
]
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
    folder = ROOT / "docs" / "decisions"
    pages = sorted(folder.rglob("0*.md"), key=lambda page: page.name)
    numbers = [page.name.partition("-")[0] for page in pages]
    assert len(numbers) == len(set(numbers)), numbers
    for number, page in zip(numbers, pages, strict=True):
        title = page.read_text(encoding="utf-8").partition("\n")[0]
        assert re.match(rf"# 0*{int(number)}[.:] ", title), title


def test_the_index_says_what_each_decision_in_force_binds() -> None:
    folder = ROOT / "docs" / "decisions"
    index = (folder / "index.md").read_text(encoding="utf-8")
    assert [page.name for page in folder.glob("0*.md") if f"]({page.name}) | " not in index] == []


INSTALLS = re.compile(r"pip3? install ((?:[^`\n#]|(?<! )#)*)")
OWN_NAME = re.compile(r"robotd(-[a-z-]+)?(\[[a-z,]+\])?")


@pytest.mark.parametrize("page", EVERY_PAGE, ids=lambda page: str(page.relative_to(ROOT)))
def test_nothing_of_robotd_is_installed_from_an_index(page: Path) -> None:
    """It is on none: a package of its name there would be a stranger's."""
    for arguments in INSTALLS.findall(page.read_text(encoding="utf-8")):
        words = shlex.split(arguments)
        by_name = [
            word
            for before, word in itertools.pairwise(["", *words])
            if OWN_NAME.fullmatch(word) and before != "--editable"
        ]
        assert not by_name or "--no-index" in words, f"pip install {arguments}"


@pytest.mark.parametrize("page", [ROOT / "README.md", ROOT / "docs" / "index.md"])
def test_a_front_page_lists_every_robot_and_backend(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    robots = {path.parent.name for path in (ROOT / "robots").glob("*/robot.yaml")}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    backends = {*project["entry-points"]["robotd.backends"], "wmx"}
    assert {name for name in robots | backends if f"`{name}`" not in text} == set()
