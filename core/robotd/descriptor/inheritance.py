"""Inheritance of descriptors: ``extends`` another robot, and variants of one."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from robotd.descriptor.files import beside, is_file
from robotd.descriptor.overrides import FIXED_KEYS
from robotd.descriptor.search_path import find_robot
from robotd.descriptor.yaml_tree import YamlNode, read_yaml
from robotd.errors import DescriptorError

MAX_EXTENDS = 8
MAX_VARIANTS = 32  # each is checked, whichever is asked for


def extended(path: Path, above: tuple[Path, ...], search_path: Sequence[Path] | None) -> YamlNode:
    """Return the tree of ``path``, merged over the one that it extends."""
    tree = read_yaml(path)
    node = tree.value.pop("extends", None)
    if node is None:
        return tree
    if not isinstance(node.value, str):
        what = "must be the name of a robot, or a path"
        raise DescriptorError(what, path=path, line=node.line, key="extends")
    chain = (*above, path.absolute())
    base = _base(path, node, search_path)
    if base in chain or len(chain) >= MAX_EXTENDS:
        what = " → ".join(str(link) for link in (*chain, base))
        raise DescriptorError(
            f"extends itself or is too deep: {what}", path=path, line=node.line, key="extends"
        )
    if not is_file(base):
        what = f"file {str(base)!r} does not exist"
        raise DescriptorError(what, path=path, line=node.line, key="extends")
    merged = merge(extended(base, chain, search_path), tree)
    return replace(merged, path=path)


def _base(path: Path, node: YamlNode, search_path: Sequence[Path] | None) -> Path:
    """Return the file that ``path`` extends, by path or by name of a robot."""
    if os.sep in node.value or node.value.endswith(".yaml"):
        return beside(path, node.value)
    try:
        return find_robot(node.value, search_path)
    except DescriptorError as error:
        raise DescriptorError(str(error), path=path, line=node.line, key="extends") from None


def variants_of(tree: YamlNode) -> tuple[list[str], str | None]:
    """Return the variants' names and the default one; the model checks the rest.

    Raises DescriptorError: more than ``MAX_VARIANTS``.
    """
    variants = tree.value.get("variants")
    names = list(variants.value) if variants and isinstance(variants.value, dict) else []
    if variants and len(names) > MAX_VARIANTS:
        what = f"{len(names)} variants, the limit is {MAX_VARIANTS}"
        raise DescriptorError(what, path=variants.path, line=variants.line, key="variants")
    default = tree.value.get("default_variant")
    return names, default.value if default and default.value in names else None


def overlaid(tree: YamlNode, variant: str | None, problems: list[DescriptorError]) -> YamlNode:
    """Return ``tree`` with the values of its variant; what that cannot change: in ``problems``."""
    overlay = tree.find(["variants", variant]) if variant is not None else None
    if overlay is None or not isinstance(overlay.value, dict):
        return tree  # a variant that is not a mapping is found by the model
    for key in FIXED_KEYS:
        if key in overlay.value:
            node = overlay.value[key]
            where = f"variants.{variant}.{key}"
            what = "a variant cannot change this"
            problems.append(DescriptorError(what, path=node.path, line=node.line, key=where))
    allowed = {key: node for key, node in overlay.value.items() if key not in FIXED_KEYS}
    merged = merge(tree, replace(overlay, value=allowed))
    return replace(merged, path=tree.path, line=tree.line)


def merge(base: YamlNode, overlay: YamlNode) -> YamlNode:
    """Return ``base`` overridden by ``overlay``; neither is changed.

    Mappings merge key by key; scalars and lists replace what was there. A null deletes the key,
    which brings back its default. A null for a key that the base does not have stays a null, so
    that a misspelt deletion is found by the validation instead of being lost.
    """
    if not (isinstance(base.value, dict) and isinstance(overlay.value, dict)):
        return overlay
    children = dict(base.value)
    for key, node in overlay.value.items():
        if key not in children:
            children[key] = node
        elif node.value is None:
            del children[key]
        else:
            children[key] = merge(children[key], node)
    return YamlNode(children, overlay.path, overlay.line)
