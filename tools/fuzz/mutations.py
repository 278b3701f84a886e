"""Mutations of a valid text: by byte and by structure."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from copy import deepcopy
from random import Random
from typing import Any

import yaml
from lxml import etree

Mutator = Callable[[Random, str, Sequence[str]], str]
"""From a random source, a text, and other texts of its kind to another text."""

NUMBERS = (
    *("0", "-0", "-1", "1e400", "-1e-400", "nan", "-.inf", ".nan", "0x7fffffff", "1_0", "٣"),
    *("9" * 30, "9" * 5000, "2147483648", "-2147483649", "9223372036854775808", "1e308", "0.1e1e1"),
)
TOKENS = (
    *(b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"\xed\xa0\x80", b"\xe2\x80\xa8", b"\r", b"\t"),
    *(b"{", b"[", b"- ", b"? ", b"&a ", b"*a ", b"!!python/object/apply:os.system ", b"<<: "),
    *(b"<!DOCTYPE x [<!ENTITY e SYSTEM 'file:///etc/passwd'>]>", b"&e;", b"<![CDATA[", b"<!--"),
    *(b"../../../etc/passwd", b"/dev/zero", b"$NODEID+", b"%(x)s", b"${x}", b"%n%s", b"'", b'"'),
    *(b"---\n", b"]]>", b"\x1b[", b"#"),
)
PLACES = 6  # changes of one text, at most
LARGE = (100_000, 300_000, 900_000)  # bytes of an amplified text, about


def mutate_bytes(random: Random, data: bytes) -> bytes:
    """A few changes anywhere, blind to what the bytes mean."""
    content = bytearray(data)
    for _ in range(random.randint(1, PLACES)):
        at = random.randint(0, len(content))
        size = min(random.choice((1, 1, 2, 8, 64, 1000)), len(content) - at)
        match random.randrange(7):
            case 0:
                del content[at : at + size]
            case 1:
                content[at:at] = random.randbytes(size)
            case 2:
                content[at:at] = random.choice(TOKENS)
            case 3:
                content[at : at + size] = random.randbytes(size)
            case 4:
                content[at:at] = content[at : at + size] * random.choice((1, 2, 50))
            case 5:
                content[at : at + 1] = random.choice(NUMBERS).encode()
            case 6 if random.random() < 0.2:
                del content[at:]
    return bytes(content)


def amplify(random: Random, data: bytes) -> bytes:
    """One stretch of the text, many times over: finds what grows faster than its input."""
    lines = data.splitlines(keepends=True) or [b""]
    begin = random.randrange(len(lines))
    part = b"".join(lines[begin : begin + random.choice((1, 1, 3, 20))]) or b" "
    if random.random() < 0.3:
        at = random.randrange(len(part))
        part = part[at : at + random.choice((1, 4, 20))] or b"["
    return (
        b"".join(lines[:begin])
        + part * (random.choice(LARGE) // len(part))
        + b"".join(lines[begin:])
    )


def mutate_lines(random: Random, text: str, others: Sequence[str]) -> str:
    """Lines and words moved, doubled, lost, indented, or taken from another text."""
    lines = text.split("\n")
    foreign = random.choice(others).split("\n")
    for _ in range(random.randint(1, PLACES)):
        at, other = random.randrange(len(lines)), random.randrange(len(lines))
        match random.randrange(7):
            case 0:
                lines[at], lines[other] = lines[other], lines[at]
            case 1:
                lines.insert(at, lines[other])
            case 2 if len(lines) > 1:
                del lines[at]
            case 3:
                lines[at] = "  " * random.randrange(4) + lines[at]
            case 4:
                lines[at] = _another_word(random, lines[at], random.choice(foreign))
            case 5:
                lines[at] = re.sub(r"[-\d.]+", random.choice(NUMBERS), lines[at], count=1)
            case 6:
                lines[at] = random.choice(foreign)
    return "\n".join(lines)


def mutate_yaml(random: Random, text: str, others: Sequence[str]) -> str:
    """The tree with branches moved, doubled, lost, or with other values."""
    tree = yaml.safe_load(text)
    donors = [node for other in (text, *others) for node in _branches(yaml.safe_load(other))]
    values = [node[key] for node, key in donors]
    for _ in range(random.randint(1, PLACES)):
        node, key = random.choice(_branches(tree) or [([0], 0)])
        match random.randrange(4):
            case 0 if len(node) > 1:
                del node[key]
            case 1:
                node[key] = random.choice((None, True, [], {}, "", -1, 1.5, [[]], "x" * 3000))
            case 2 if isinstance(node, dict):
                node[random.choice(donors)[1]] = deepcopy(random.choice(values))
            case _:
                node[key] = deepcopy(random.choice(values))
    return yaml.safe_dump(tree, allow_unicode=True, default_flow_style=random.random() < 0.2)


def mutate_xml(random: Random, text: str, others: Sequence[str]) -> str:
    """The tree with elements moved, copied, lost, renamed, or with other values."""
    root = etree.fromstring(text.encode())
    elements = list(root.iter(etree.Element))
    foreign = list(etree.fromstring(random.choice(others).encode()).iter(etree.Element))
    for _ in range(random.randint(1, PLACES)):
        element, other = random.choice(elements), random.choice(foreign)
        parent = element.getparent()
        match random.randrange(6):
            case 0 if parent is not None:
                parent.remove(element)
            case 1:
                element.append(deepcopy(other))
            case 2:
                element.tag = random.choice((other.tag, "x", "x" * 3000))
            case 3:
                element.text = random.choice((*NUMBERS, "", "x", "1 2"))
            case 4:
                name = random.choice(("Axis", "ver", "name", "type", *element.keys()))
                element.set(name, random.choice((*NUMBERS, "", "x" * 3000)))
            case 5:
                element.addnext(deepcopy(element)) if parent is not None else None
    return etree.tostring(root, encoding="unicode")


def _branches(tree: Any) -> list[tuple[Any, Any]]:
    """Every place of a tree of dicts and lists: the container, and the key or index."""
    keys = tree if isinstance(tree, dict) else range(len(tree)) if isinstance(tree, list) else ()
    found: list[tuple[Any, Any]] = [(tree, key) for key in keys]
    return found + [place for node, key in found for place in _branches(node[key])]


def _another_word(random: Random, line: str, foreign: str) -> str:
    words, new = re.findall(r"\w+", line), re.findall(r"\w+", foreign)
    return line.replace(random.choice(words), random.choice(new), 1) if words and new else foreign
