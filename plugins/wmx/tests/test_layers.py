"""Imports of the backend: the plugin API and libraries, and no other backend."""

from __future__ import annotations

import ast

import pytest

from standin_build import PLUGIN, SITE

MODULES = sorted((PLUGIN / "robotd_wmx").glob("*.py"))


@pytest.mark.parametrize("module", MODULES, ids=lambda path: path.stem)
def test_only_the_plugin_api_is_imported(module: object) -> None:
    tree = ast.parse(module.read_text("utf-8"))  # type: ignore[attr-defined]
    imported = {
        name
        for node in ast.walk(tree)
        for name in (
            [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else [alias.name for alias in node.names]
            if isinstance(node, ast.Import)
            else []
        )
    }
    top = {name: name.split(".")[0] for name in imported}
    ours = {name for name in imported if top[name].startswith("robotd")}
    assert {name for name in ours if top[name] != "robotd_wmx"} <= {
        "robotd.api",
        "robotd_cia402.code_tables",
        "robotd_wmx_parameters",
    }


def test_the_stand_in_is_not_part_of_the_package() -> None:
    installed = {path.name for path in SITE.rglob("*")}
    assert any(name.startswith("_native") for name in installed)
    assert not any("standin" in name for name in installed)
