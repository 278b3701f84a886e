"""The backend uses nothing of robotd that a third party could not."""

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
    ours = {name for name in imported if name.split(".")[0] == "robotd"}
    assert ours <= {"robotd.api"}


def test_the_stand_in_is_not_part_of_the_package() -> None:
    installed = {path.name for path in SITE.rglob("*")}
    assert any(name.startswith("_native") for name in installed)
    assert not any("standin" in name for name in installed)
