"""Mutants as installed backends."""

from __future__ import annotations

import gc
import locale
import logging
import os
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from tests.features.conformance.runs.mutants.plugin import Mutant

InstallMutant = Callable[[type[Mutant]], str]
InstallPlugin = Callable[[str], str]
InstallSource = Callable[[str], None]

ROOT = Path(__file__).parents[4]


@pytest.fixture(autouse=True)
def process_as_before(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Undo what a mutant has changed in this process."""
    monkeypatch.chdir(Path.cwd())
    monkeypatch.setattr(sys, "excepthook", sys.excepthook)
    environment, numbers = dict(os.environ), locale.setlocale(locale.LC_ALL)
    interval_s, level = sys.getswitchinterval(), logging.getLogger().level
    user_signal = signal.getsignal(signal.SIGUSR1)
    mask = os.umask(0)
    os.umask(mask)
    yield
    os.umask(mask)
    signal.signal(signal.SIGUSR1, user_signal)
    logging.getLogger().setLevel(level)
    sys.setswitchinterval(interval_s)
    gc.enable()
    locale.setlocale(locale.LC_ALL, numbers)
    os.environ.clear()
    os.environ.update(environment)


def announce(folder: Path, name: str, target: str) -> None:
    """Make ``target`` the backend ``name`` of a distribution in ``folder``."""
    info = folder / f"{name.lower()}-1.0.dist-info"
    info.mkdir()
    metadata = f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n"
    (info / "METADATA").write_text(metadata, encoding="utf-8")
    entry = f"[robotd.backends]\n{name} = {target}\n"
    (info / "entry_points.txt").write_text(entry, encoding="utf-8")


@pytest.fixture
def install_plugin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> InstallPlugin:
    """Make a class of ``installed`` a distribution on ``sys.path``; returns its backend's name.

    It is there for processes that a test starts, too.
    """

    def install(name: str) -> str:
        announce(tmp_path, name, f"tests.features.conformance.runs.installed:{name}")
        monkeypatch.syspath_prepend(str(tmp_path))
        monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), str(ROOT)]))
        return name

    return install


@pytest.fixture
def install_mutant(install_plugin: InstallPlugin) -> InstallMutant:
    """Make a mutant a distribution, as ``install_plugin`` does."""
    return lambda mutant: install_plugin(mutant.__name__)


@pytest.fixture
def install_source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> InstallSource:
    """Make a module with this source the backend ``odd``, for processes that a test starts."""

    def install(source: str) -> None:
        announce(tmp_path, "odd", "odd_module")
        (tmp_path / "odd_module.py").write_text(source, encoding="utf-8")
        monkeypatch.setenv("PYTHONPATH", str(tmp_path))

    return install
