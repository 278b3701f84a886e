"""``robotd docs``, and the pages that texts of the program name."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from robotd.errors import InvalidArgument
from robotd_doctor.docs_command import docs, pages

ROOT = Path(__file__).parents[3]
ROOMS = ("core", "features", "plugins", "ros")


def run(*words: str) -> Result:
    return CliRunner().invoke(docs, words)


def test_pages_are_listed_with_their_titles() -> None:
    lines = run().output.splitlines()
    assert [line for line in lines if not line.startswith(" ")] == [
        "tutorial", "how-to", "reference", "explanation",
    ]  # fmt: skip
    assert any(
        line.split() == ["how-to/operate", "Operate", "a", "running", "robot"] for line in lines
    )


def test_a_page_is_printed_by_its_name_or_its_file() -> None:
    page = (ROOT / "docs" / "how-to" / "wmx.md").read_text(encoding="utf-8")
    assert run("how-to/wmx").output == run("docs/how-to/wmx.md").output == page


def test_keys_are_printed_in_the_place_of_their_directive() -> None:
    text = run("reference/descriptor").output
    assert "| `backend` | text | `sim` |" in text
    assert ":::" not in text


def test_commands_lead_to_their_help() -> None:
    text = run("reference/cli").output
    assert "`robotd move --help` prints its options." in text
    assert ":::" not in text


def test_classes_are_printed_with_their_methods() -> None:
    text = run("reference/plugin-api").output
    assert "class IoDriver(" in text
    assert "read_inputs(self, byte: 'int', length: 'int') -> 'bytes'" in text
    assert "eval-rst" not in text
    assert "Method resolution order" not in text
    assert "__weakref__" not in text


@pytest.mark.parametrize(
    "page", [name for name, path in pages().items() if "eval-rst" in path.read_text("utf-8")]
)
def test_no_directive_is_left(page: str) -> None:
    result = run(page)
    assert result.exit_code == 0
    assert "eval-rst" not in result.output


def test_an_unknown_page_is_named_with_the_nearest() -> None:
    with pytest.raises(InvalidArgument, match="did you mean 'how-to/wmx'"):
        CliRunner().invoke(docs, ["how-to/wnx"], catch_exceptions=False)


def test_each_page_that_the_program_names_is_there() -> None:
    texts = (path.read_text("utf-8") for room in ROOMS for path in (ROOT / room).rglob("*.py"))
    wanted = re.compile(r"robotd docs ((?:how-to|reference)/[\w-]+)")
    named = {page for text in texts for page in wanted.findall(text)}
    assert len(named) > 5
    assert named <= pages().keys()
