"""Completion of a shell: commands, options, and their values."""

from __future__ import annotations

import pytest
from click.shell_completion import ShellComplete

from robotd.cli import main


def complete(*words: str) -> list[str]:
    """Completions of the last word."""
    shell = ShellComplete(main, {}, "robotd", "_ROBOTD_COMPLETE")
    return [completion.value for completion in shell.get_completions([*words[:-1]], words[-1])]


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["rec"], ["record", "recover"]),
        (["run", "--robot", "cr"], ["cr3a", "cr5a"]),
        (["export", "moveit", "--robot", "bay"], ["baymax"]),
        (["run", "--backend", "can"], ["canopen"]),
        (["move", "joint1"], ["joint1="]),
        (["jog", "right_joint6"], ["right_joint6"]),
        (["sim", "inject", "amp"], ["amp_alarm"]),
    ],
)
def test_names_are_completed(words: list[str], expected: list[str]) -> None:
    assert sorted(complete(*words)) == expected
