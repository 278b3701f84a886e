"""Real distributions for the plugin manager: folders with metadata and a module, on sys.path."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from textwrap import dedent

import pytest

Install = Callable[..., Path]

BACKEND = """
    from robotd.api import BackendInfo, hookimpl

    @hookimpl
    def robotd_backend():
        return BackendInfo(summary="a test", api_version=1)
"""


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """``install(name, source, distribution=..., version=..., group=...)`` a plugin.

    The plugin's module is called ``plugin_<distribution>``.
    """
    before = set(sys.modules)

    def make(
        name: str,
        source: str = BACKEND,
        *,
        distribution: str = "acme",
        version: str = "1.2",
        group: str = "robotd.backends",
    ) -> Path:
        site = tmp_path / distribution
        module = f"plugin_{distribution.replace('-', '_')}"
        info = site / f"{distribution.replace('-', '_')}-{version}.dist-info"
        info.mkdir(parents=True)
        metadata = f"Metadata-Version: 2.1\nName: {distribution}\nVersion: {version}\n"
        (info / "METADATA").write_text(metadata, encoding="utf-8")
        (info / "entry_points.txt").write_text(f"[{group}]\n{name} = {module}\n", encoding="utf-8")
        code = dedent(source).replace("{name}", name)
        (site / f"{module}.py").write_text(code, encoding="utf-8")
        monkeypatch.syspath_prepend(str(site))
        return site

    yield make
    for module in set(sys.modules) - before:
        if module.startswith("plugin_"):
            del sys.modules[module]
