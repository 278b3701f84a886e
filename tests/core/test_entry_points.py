"""Entry points are read once, and again where ``sys.path`` has changed."""

from __future__ import annotations

import importlib.metadata

import pytest
from tests.installed_plugin import Install

from robotd.entry_points import entry_points, installed_names


def test_they_are_read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    assert {entry.name for entry in entry_points(group="robotd.backends")} >= {"sim", "canopen"}
    monkeypatch.delattr(importlib.metadata, "entry_points")
    assert {entry.name for entry in entry_points(group="robotd.backends")} >= {"sim", "canopen"}
    assert "sim" in installed_names("robotd.backends").entries
    assert "none" not in installed_names("robotd.backends").entries


def test_those_of_a_folder_that_is_added_are_found(install: Install) -> None:
    assert "mine" not in installed_names("robotd.backends").entries
    install("mine")
    origin, entry = installed_names("robotd.backends").entries["mine"]
    assert (origin.module, entry.value) == ("plugin_acme", "plugin_acme")
    assert str(origin) == "'mine' (plugin_acme of acme 1.2)"
