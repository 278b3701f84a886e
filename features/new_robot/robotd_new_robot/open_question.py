"""Questions that a URDF leaves open: errors without a terminal, asked on one."""

from __future__ import annotations

from typing import Any

from robotd.api import DescriptorError


class OpenQuestion(DescriptorError):
    """A choice that the URDF does not contain.

    Attributes:
        question: for a person.
        option: attribute of ``Choices`` that is the answer.
        default: the guess; None without one.
        choices: valid answers, texts; empty: a number above 0.
    """

    def __init__(
        self,
        what: str,
        *,
        question: str,
        option: str,
        default: Any = None,
        choices: tuple[str, ...] = (),
        **place: Any,
    ) -> None:
        super().__init__(what, **place)
        self.question, self.option = question, option
        self.default, self.choices = default, choices
