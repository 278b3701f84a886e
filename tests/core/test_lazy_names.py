"""Names that are imported when they are first read."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import pytest

SOURCE = """
from typing import TYPE_CHECKING

from robotd.lazy_names import lazy_names

if TYPE_CHECKING:
    from lazy_origin import first, second as other
else:
    __getattr__, __dir__ = lazy_names(__name__)
"""


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    (tmp_path / "lazy_module.py").write_text(SOURCE)
    (tmp_path / "lazy_origin.py").write_text("first, second = object(), object()\n")
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("lazy_module", "lazy_origin"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    return __import__("lazy_module")


def test_a_name_is_imported_when_it_is_first_read(module: ModuleType) -> None:
    assert "lazy_origin" not in sys.modules
    first, other = module.first, module.other
    origin = sys.modules["lazy_origin"]
    assert (first, other) == (origin.first, origin.second)


def test_a_name_is_looked_up_once(module: ModuleType) -> None:
    first = module.first
    vars(sys.modules["lazy_origin"])["first"] = object()
    assert module.first is first


def test_all_names_are_listed_before_they_are_read(module: ModuleType) -> None:
    assert {"first", "other"} <= {*dir(module)}
    assert "second" not in dir(module)
    assert "lazy_origin" not in sys.modules


@pytest.mark.parametrize("name", ["second", "nonsense", "__wrapped__"])
def test_another_name_is_no_attribute(module: ModuleType, name: str) -> None:
    with pytest.raises(AttributeError, match=f"module 'lazy_module' has no attribute '{name}'"):
        getattr(module, name)
