"""Values of the command line that replace those of a descriptor: ``--set backends.sim.seed=7``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from robotd.descriptor.yaml_tree import YamlNode, read_value
from robotd.errors import DescriptorError

ORIGIN = Path("--set")
"""Named in place of a file in the errors about such a value."""

FIXED_KEYS = ("schema", "name", "extends", "variants", "default_variant")
"""Keys that only the file itself can hold: neither a variant nor an override changes them."""


@dataclass(frozen=True)
class Override:
    """One value of the command line.

    Attributes:
        keys: path of the key from the top of the file; list items by their index from 0.
        node: the value, typed as in a file.
        text: ``KEY=VALUE``, as typed.
    """

    keys: tuple[str, ...]
    node: YamlNode
    text: str

    @property
    def key(self) -> str:
        """The dotted path, as errors show it."""
        return ".".join(self.keys)


def parse_override(text: str) -> Override:
    """Read ``KEY=VALUE``: a dotted key path and a YAML value, for example ``cycle.rate_hz=250``.

    Raises DescriptorError: the text has another form, the value is not YAML, or the key cannot be
    changed from outside the file.
    """
    path, equals, value = text.partition("=")
    keys = tuple(path.strip().split("."))
    if not equals or not all(keys):
        raise _error(f"{text!r} is not KEY=VALUE, for example cycle.rate_hz=250", None)
    if keys[0] in FIXED_KEYS:
        raise _error(f"{keys[0]} cannot be set from the command line", path)
    try:
        node = read_value(value, ORIGIN)
    except DescriptorError:
        raise _error(f"{value!r} is not a value of a descriptor", path) from None
    return Override(keys, node, text)


def override(key: str, value: object) -> Override:
    """Return the override of a dotted key by a number, truth value, text or path."""
    plain = str(value) if isinstance(value, Path) else value
    return Override(tuple(key.split(".")), YamlNode(plain, ORIGIN, None), f"{key}={plain}")


def overridden(tree: YamlNode, overrides: Sequence[Override]) -> YamlNode:
    """Return ``tree`` with each override in place; ``tree`` itself is not changed.

    Missing sections are created; the models find unknown keys. Raises DescriptorError where a
    path leads into a value that is neither a section nor a list, or outside a list.
    """
    for override in overrides:
        changed = _placed(tree, override.keys, override)
        tree = replace(changed, path=tree.path, line=tree.line)
    return tree


def _placed(tree: YamlNode | None, keys: Sequence[str], override: Override) -> YamlNode:
    if not keys:
        return override.node
    key, *rest = keys
    children = {} if tree is None or tree.value is None else tree.value
    if isinstance(children, dict):
        changed = children | {key: _placed(children.get(key), rest, override)}
        return YamlNode(changed, override.node.path, None)
    if not isinstance(children, list):
        where = override.key.removesuffix("." + ".".join(keys))
        raise _error(f"{where} is {children!r}, not a section with keys", override.key)
    if not (key.isdecimal() and int(key) < len(children)):
        raise _error(f"{key!r} is not an index of a list of {len(children)} items", override.key)
    index = int(key)
    items = [*children]
    items[index] = _placed(items[index], rest, override)
    return YamlNode(items, override.node.path, None)


def _error(message: str, key: str | None) -> DescriptorError:
    return DescriptorError(message, path=ORIGIN, key=key)
