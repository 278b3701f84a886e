"""Checks that docs/tutorial/first-backend.md names find the faults that it makes."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from tests.features.conformance.runs.kit import run_kit

from robotd.errors import PluginError
from robotd.plugin.manager import load_backend
from robotd_conformance.new_backend_command import write_backend

TUTORIAL = Path(__file__).parents[4] / "docs" / "tutorial" / "first-backend.md"

Break = Callable[[str, str, str], None]


@pytest.fixture
def break_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Break]:
    """The generated package, importable; ``break_it(file, old, new)`` changes it."""
    write_backend("acme", tmp_path)
    site = tmp_path / "robotd-acme"
    info = site / "robotd_acme-0.1.0.dist-info"
    info.mkdir()
    metadata = "Metadata-Version: 2.1\nName: robotd-acme\nVersion: 0.1.0\n"
    (info / "METADATA").write_text(metadata, encoding="utf-8")
    entry = "[robotd.backends]\nacme = robotd_acme\n"
    (info / "entry_points.txt").write_text(entry, encoding="utf-8")
    monkeypatch.syspath_prepend(str(site))

    def change(file: str, old: str, new: str) -> None:
        path = site / "robotd_acme" / file
        text = path.read_text(encoding="utf-8")
        assert old in text
        path.write_text(text.replace(old, new), encoding="utf-8")

    yield change
    for module in [name for name in sys.modules if name.split(".")[0] == "robotd_acme"]:
        del sys.modules[module]


def test_degrees(break_it: Break) -> None:
    broken = "servos[axis].move(target * 57.29578, profile)"
    assert broken in TUTORIAL.read_text(encoding="utf-8")
    break_it("axes.py", "servos[axis].move(target, profile)", broken)
    check = "test_units.py::test_a_commanded_radian_is_a_measured_radian"
    assert set(run_kit("acme", check).failed) == {check}
    assert check in TUTORIAL.read_text(encoding="utf-8")


def test_a_forgotten_position(break_it: Break) -> None:
    line = "self.position = 0.0"
    assert f"`{line}`" in TUTORIAL.read_text(encoding="utf-8")
    break_it("servo.py", "self.is_on = on", f"self.is_on = on\n            {line}")
    check = "test_enable.py::test_enabling_after_a_move_by_hand_does_not_jump"
    assert set(run_kit("acme", check).failed) == {check}
    assert check in TUTORIAL.read_text(encoding="utf-8")


def test_a_misspelt_hook(break_it: Break) -> None:
    break_it("__init__.py", "def robotd_axes(", "def robotd_axis(")
    told = "'acme' (robotd_acme of robotd-acme 0.1.0): unknown hook 'robotd_axis'; did you mean"
    assert told in TUTORIAL.read_text(encoding="utf-8")
    with pytest.raises(PluginError) as caught:
        load_backend("acme")
    assert told in str(caught.value)
