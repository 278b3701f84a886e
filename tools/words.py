"""Words that comments, docstrings, texts for users and pages do not use, and what they use instead.

``make lint`` reads all modules and pages under version control. The table is the rule: a row has a
literal that makes a file worth reading, a pattern, and the plain English for it. Which noun is used
for a thing is said in ``docs/reference/glossary.md``.
"""

from __future__ import annotations

import ast
import io
import re
import subprocess
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
NOT_READ = (
    "CHANGELOG.md",
    "tools/words.py",
    "tests/tools/test_words.py",
)
OPENING = re.compile(r'^ *"""(What|Which|Whether|Why|Who|How|Where|As|Of)\b', re.MULTILINE)
CODE = re.compile(r"``[^`]*``|`[^`]*`")


class Rule(NamedTuple):
    """A pattern that is not used, in lower case; what each match contains; plain words for it."""

    literal: str
    pattern: str
    instead: str


OTHER = "(?:an?other|its|that|the|this|which)"
RULES = (
    Rule("stands", r"\bstands\b(?! (?:still|for|on|alone|out|in|across)\b)(?![-:])", "is at rest"),
    Rule("stood", r"\bstood\b(?! (?:still|for|on|alone|out|in)\b)", "was at rest, paused"),
    Rule("noted", r"\bnoted\b(?!:)", "recorded, logged"),
    Rule("raises as", r"\braises as\b", "Raises the errors of ``name``"),
    Rule("is of ", rf"\bis of {OTHER}\b", "belongs to, comes from"),
    Rule("are of ", rf"\bare of {OTHER}\b", "belong to, come from"),
    Rule("what is ", r"\bwhat is (?:beyond|of)\b", "a noun: values beyond ..., files of ..."),
    Rule("of a moment ago", r"\bof a moment ago\b", "previous, earlier"),
    Rule("none was sent", r"\bnone was sent\b", "no setpoint (frame, message) was sent"),
    Rule("as above", r"\bas above\b", "the content again, or where it is described"),
    Rule(
        "told", r"\b(?:is|are|was|were|been|unless|not) told\b", "is reported, is asked, by default"
    ),
    Rule("begin", r"\b(?:the|a|its|their) begin\b", "start"),
    Rule("heard", r"\bheard\b", "received"),
    Rule("whoever", r"\bwhoever\b", "the actor: client, worker, caller"),
    Rule("meant so", r"\bmeant so\b", "by design"),
    Rule(
        "way",
        r"\b(?:way to rest|(?:long|longer|longest|short|shorter|straight|whole) way\b(?! round\b)"
        r"|way of (?:the|a|its) (?:axis|joint|motion|stop|tool)\b)",
        "distance, displacement, travel, path",
    ),
    Rule(
        "behind",
        r"\bbehind (?:the|its|a) (?:first|last|next) (?:joint|point|setpoint|step)\b",
        "after, beyond",
    ),
    Rule("for each in", r"\bfor each in\b", "a noun as the variable of the loop"),
)


def page_text(text: str) -> Iterator[tuple[int, str]]:
    """Yield numbered lines of a page, without its blocks of code."""
    in_block = False
    for number, line in enumerate(text.splitlines(), 1):
        in_block ^= line.lstrip().startswith("```")
        if not in_block and not line.startswith("    "):
            yield number, line


def module_text(text: str, *, is_test: bool = False) -> Iterator[tuple[int, str]]:
    """Yield numbered comments, lines of docstrings and texts, and heads of loops of a module.

    The texts of a test are data.
    """
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            yield token.start[0], token.string
    tree = ast.parse(text)
    docstrings = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, (ast.For, ast.comprehension)):
            yield node.iter.lineno, f"for {ast.unparse(node.target)} in"
        is_read = not is_test or id(node) in docstrings
        if is_read and isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield from enumerate(node.value.splitlines(), node.lineno)


def findings(name: str, text: str) -> Iterator[str]:
    """Yield the places of a file that break a rule, with what to write."""
    is_page, is_test = name.endswith(".md"), name.startswith("tests/")
    for found in () if is_page or "tests/" in name else OPENING.finditer(text):
        number = text.count("\n", 0, found.start()) + 1
        yield f'{name}:{number}: "{found[1]}": begin a docstring with a noun or a verb'
    lower = text.lower()
    rules = [rule for rule in RULES if rule.literal in lower and re.search(rule.pattern, lower)]
    if not rules:  # as in most files: parsing them all would take some seconds
        return
    lines = page_text(text) if is_page else module_text(text, is_test=is_test)
    for number, line in sorted(lines):
        for rule in rules:
            for found in re.finditer(rule.pattern, CODE.sub("", line).lower()):
                yield f'{name}:{number}: "{found[0]}": write {rule.instead}'


def main() -> None:
    command = ["git", "ls-files", "*.py", "*.md"]
    listed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    names = [name for name in listed.splitlines() if not name.startswith(NOT_READ)]
    texts = {name: (ROOT / name).read_text("utf-8") for name in names if (ROOT / name).exists()}
    found = [place for name, text in texts.items() for place in findings(name, text)]
    for place in found:
        print(place)
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
