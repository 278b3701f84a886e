"""Entry points are read once, and again where ``sys.path`` has changed."""

from __future__ import annotations

import importlib.metadata

import pytest
from tests.installed_plugin import Install

from robotd.entry_points import entry_points


def test_they_are_read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    assert {entry.name for entry in entry_points(group="robotd.backends")} >= {"sim", "canopen"}
    monkeypatch.delattr(importlib.metadata, "entry_points")
    assert {entry.name for entry in entry_points(group="robotd.backends")} >= {"sim", "canopen"}
    assert [entry.name for entry in entry_points(group="robotd.backends", name="sim")] == ["sim"]
    assert not list(entry_points(group="robotd.backends", name="none"))


def test_those_of_a_folder_that_is_added_are_found(install: Install) -> None:
    assert not list(entry_points(group="robotd.backends", name="mine"))
    install("mine")
    [entry] = entry_points(group="robotd.backends", name="mine")
    assert entry.value == "plugin_acme"
