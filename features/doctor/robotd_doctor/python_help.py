"""Reference of Python names as text, in the place of the directives that make it on the site."""

from __future__ import annotations

import inspect
import pydoc
import re
from collections.abc import Callable, Collection, Iterator
from enum import Enum
from importlib import import_module
from pkgutil import resolve_name
from typing import Any

# A block of reST with one directive or several, each with its argument and its options.
BLOCK = re.compile(r"^```\{eval-rst\}\n(.*?)^```$", re.MULTILINE | re.DOTALL)
DIRECTIVE = re.compile(r"^\.\. ([\w-]+):: *(\S+)\n((?:   :.*\n)*)", re.MULTILINE)
OPTION = re.compile(r"^   :([\w-]+): *(.*)$", re.MULTILINE)
RULE = "\n |  " + 70 * "-" + "\n |  "  # between the sections of a class
ORDER = re.compile(r"^ \|  Method resolution order:\n(?: \|   .*\n)+ \|  \n", re.MULTILINE)
COMMON = re.compile(
    r"Data descriptors .*\n(?: \|  (?:__.*__|    .*|)\n?)*$"
)  # all classes have these


def _is_class(value: Any, base: type = object) -> bool:
    return inspect.isclass(value) and issubclass(value, base)


def _is_driver(value: Any) -> bool:
    """Return True for a class that a backend implements."""
    return _is_class(value) and (value.__name__.endswith("Driver") or inspect.isabstract(value))


KINDS: dict[str, Callable[[Any], bool]] = {  # the first that matches decides
    "exceptions": lambda value: _is_class(value, Exception),
    "drivers": _is_driver,
    "enums": lambda value: _is_class(value, Enum),
    "classes": _is_class,
    "functions": inspect.isfunction,
    "data": lambda value: True,
}


def exported(module: str, kind: str, skipped: Collection[str] = ()) -> Iterator[str]:
    """Yield the names in ``__all__`` of a module that are of one of ``KINDS``, in its order."""
    found = import_module(module)
    for name in found.__all__:
        value = getattr(found, name)
        found_kind = next(kind for kind, matches in KINDS.items() if matches(value))
        if found_kind == kind and name not in skipped:
            yield name


def with_help(markdown: str) -> str:
    """Return a page in which each directive of Python names is replaced by their help."""
    return BLOCK.sub(lambda block: DIRECTIVE.sub(_help, block[1]).strip(), markdown)


def _help(found: re.Match[str]) -> str:
    kind, place, given = found.groups()
    options = dict(OPTION.findall(given))
    if kind == "exports":
        names = exported(place, options["kind"], options.get("except", "").split())
        return "\n".join(_text_of(f"{place}:{name}") for name in names)
    if kind.startswith("auto"):
        return _text_of(place)
    return f"(The table of {place} is on the site: `make docs` in a clone builds it.)\n"


def _text_of(place: str) -> str:
    """Return the help of a name as a block of text, without what every class has."""
    text = pydoc.plain(pydoc.text.document(resolve_name(place)))
    sections = ORDER.sub("", text).split(RULE)
    kept = [section for section in sections if not COMMON.fullmatch(section)]
    shown = RULE.join(kept).rstrip(" |\n")
    return f"```text\n{shown}\n```\n"
