"""Merging of an overlay (a variant, or a file that extends another) into a base."""

from __future__ import annotations

from robotd.descriptor.source import Node


def merge(base: Node, overlay: Node) -> Node:
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
    return Node(children, overlay.path, overlay.line)
