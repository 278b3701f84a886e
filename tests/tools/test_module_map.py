"""The map of all modules shows the head of each."""

from __future__ import annotations

from pathlib import PurePath

import pytest
from tools.module_map import head_of, page

MODULES = [
    (PurePath("core/robotd/motion/limits.py"), '"""Limits of ``joints``.\n\nMore.\n"""\nA = 1\n'),
    (PurePath("core/robotd/motion/bare.py"), "A = 1\n"),
    (PurePath("core/robotd/motion/__init__.py"), '"""Motion."""\n'),
    (PurePath("core/robotd/robot.py"), '"""A robot."""\n'),
]


@pytest.mark.parametrize(
    ("name", "text", "head"),
    [
        ("a.py", '"""Limits of ``joints``.\n\nMore.\n"""', "Limits of `joints`."),
        ("a.ts", '// The page.\n// More.\nimport "x";\n', "The page."),
        ("a.cpp", "#include <cmath>\n// not the head\n", ""),
        ("a.py", "", ""),
    ],
)
def test_the_head_is_the_first_line(name: str, text: str, head: str) -> None:
    assert head_of(PurePath(name), text) == head


def test_a_folder_is_headed_by_its_package() -> None:
    text = "\n".join(page(MODULES))
    folder, motion = text.split("## ")[1:]
    assert folder.splitlines() == ["core/robotd", "", "- `robot.py`: A robot.", ""]
    assert motion.splitlines()[2:] == [
        "Motion.",
        "",
        "- `bare.py`",
        "- `limits.py`: Limits of `joints`.",
    ]
