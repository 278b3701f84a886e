"""``tools.words`` finds words of its table where people read them, and nowhere else."""

from __future__ import annotations

import pytest
from tools.words import RULES, Rule, findings

MODULE = '''"""{}"""

count = 1  # {}
text = "{}"
'''
SENTENCES = {
    "stands": "the axis stands there",
    "stood": "the axis stood there",
    "noted": "The result is noted.",
    "raises as": "Raises as ``open``.",
    "is of ": "the frame is of another node",
    "are of ": "the frames are of the node",
    "what is ": "what is beyond is dropped",
    "of a moment ago": "the stop of a moment ago",
    "none was sent": "none was sent",
    "as above": "It is done as above.",
    "told": "the client is told so",
    "heard": "the answer was not heard",
    "whoever": "whoever asked",
    "meant so": "it is meant so",
    "begin": "at the begin of the path",
    "way": "its way to rest",
    "behind": "it brakes behind the last point",
}


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.literal.strip())
def test_a_word_is_found_in_comments_docstrings_texts_and_pages(rule: Rule) -> None:
    if rule.literal == "for each in":
        found = [*findings("a.py", "for each in (1, 2):\n    print(each)\n")]
        assert [place.split(":")[1] for place in found] == ["1"]
        return
    sentence = SENTENCES[rule.literal]
    places = [*findings("a.py", MODULE.format(sentence, sentence, sentence))]
    assert [place.split(":")[1] for place in places] == ["1", "3", "4"]
    places = [*findings("tests/a.py", MODULE.format(sentence, sentence, sentence))]
    assert [place.split(":")[1] for place in places] == ["1", "3"]
    page = f"{sentence}\n\n```text\n{sentence}\n```\n\n    {sentence}\n"
    assert [place.split(":")[1] for place in findings("a.md", page)] == ["1"]


def test_quoted_names_and_plain_english_pass() -> None:
    plain = "It stands still and stands for a number; `noted` and ``stands`` are names."
    assert [*findings("a.py", MODULE.format(plain, plain, plain))] == []
    assert [*findings("a.md", plain)] == []


def test_a_docstring_begins_with_a_noun_or_a_verb() -> None:
    text = '''"""Axes."""


def speed() -> float:
    """Whether it moves."""
'''
    assert [place.split(":")[1] for place in findings("core/a.py", text)] == ["5"]
    assert [*findings("core/a.py", text.replace("Whether it moves", "Speed of the axis"))] == []
    assert [*findings("tests/a.py", text)] == []
