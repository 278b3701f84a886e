"""Every command of robotd in a block of a page is one: its name, options and values are parsed."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from robotd.cli import main

ROOT = Path(__file__).parents[2]
PAGES = [
    *ROOT.glob("*.md"),
    *(page for name in ("docs", "examples", "robots") for page in (ROOT / name).rglob("*.md")),
]
LINE = re.compile(r"^(?:    |\$ )(?:\.venv/bin/)?(robotd .*)$", re.MULTILINE)
BASH = re.compile(r"^```bash\n([\s\S]*?)^```", re.MULTILINE)
OF_EXAMPLES = {"--lamp"}  # options of plugins that a page generates
IN_BASH = re.compile(r"^(robotd .*)$", re.MULTILINE)


def commands(page: Path) -> Iterator[list[str]]:
    """The words of each command, without what the shell and its operators do with it."""
    text = re.sub(r" *\\\n *", " ", page.read_text(encoding="utf-8"))
    lines = [*LINE.findall(text), *IN_BASH.findall("\n".join(BASH.findall(text)))]
    for line in lines:
        words = shlex.split(line, comments=True)[1:]
        ends = [words.index(word) for word in ("&", "|", ">", "&&") if word in words]
        yield words[: min(ends, default=len(words))]


DOCUMENTED = [
    pytest.param(words, id=f"{page.relative_to(ROOT)}: {shlex.join(words)}")
    for page in PAGES
    for words in commands(page)
    if words and "..." not in words and OF_EXAMPLES.isdisjoint(words)
]


@pytest.mark.parametrize("words", DOCUMENTED)
def test_a_command_of_a_page_is_one(words: list[str]) -> None:
    with suppress(click.exceptions.Exit):  # of --help
        parse(words)


def parse(words: list[str]) -> None:
    """Parse a command line without running it. Raises click.UsageError."""
    with CliRunner().isolation():
        context: click.Context = main.make_context("robotd", [*words])
        command: click.Command = main
        left = [*context._protected_args, *context.args]
        while isinstance(command, click.Group) and left:
            name, found, left = command.resolve_command(context, left)
            assert found is not None
            command, context = found, found.make_context(name, left, parent=context)
            left = [*context._protected_args, *context.args]


def test_there_are_commands_and_a_wrong_one_is_found() -> None:
    assert len(DOCUMENTED) > 100
    with pytest.raises(click.UsageError, match="No such option '--robots'"):
        parse(["run", "--robots", "cr3a"])
