"""Advice at the start of ``robotd run``."""

from __future__ import annotations

import os

import pytest

from robotd.cli import start_summary
from robotd.robot import build_robot


def test_a_uid_without_a_name_gets_the_advice_too(monkeypatch: pytest.MonkeyPatch) -> None:
    def nameless() -> str:
        raise KeyError(f"getpwuid(): uid not found: {os.getuid()}")

    monkeypatch.setattr(start_summary, "getuser", nameless)
    monkeypatch.setattr(start_summary, "realtime_permitted", lambda priority: False)
    [text] = start_summary._missing(build_robot("cr3a", "sim"))
    assert f"#{os.getuid()} - rtprio 60" in text
