"""Mutants as installed backends."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from tests.conformance.mutants import Mutant

InstallMutant = Callable[[type[Mutant]], str]


@pytest.fixture
def install_mutant(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> InstallMutant:
    """Make a mutant a distribution on ``sys.path``; returns the name of its backend."""

    def install(mutant: type[Mutant]) -> str:
        name = mutant.__name__
        info = tmp_path / f"{name.lower()}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(
            f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n", encoding="utf-8"
        )
        target = f"tests.conformance.installed:{name}"
        (info / "entry_points.txt").write_text(
            f"[robotd.backends]\n{name} = {target}\n", encoding="utf-8"
        )
        monkeypatch.syspath_prepend(str(tmp_path))
        return name

    return install
