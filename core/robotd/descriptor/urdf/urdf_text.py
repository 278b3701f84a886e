"""Text of a URDF: decoded, declared as UTF-8, and readable by every XML parser."""

from __future__ import annotations

import codecs
import re
from contextlib import suppress
from pathlib import Path
from typing import Any

from lxml import etree

from robotd.descriptor.files import read_limited
from robotd.errors import DescriptorError

MAX_URDF_BYTES = 8_000_000

_DECLARATION = re.compile(r"\s*<\?xml\s[^>]*\?>")
_VERSION_1 = re.compile(r"""<\?xml\s+version\s*=\s*(["'])1\.\d+\1""")
_UTF8 = "<?xml version='1.0' encoding='UTF-8'?>"
_ENCODING = re.compile(r"""(<\?xml[^>]*?encoding\s*=\s*)(["'])([^"']*)\2""")
_NAMESPACE = re.compile(r"""(<robot\b[^>]*?)\sxmlns\s*=\s*(["'])[^"']*\2""")
_PREFIX = re.compile(r"Namespace prefix (\S+) ")
_COMMENT = re.compile(r"<!--(.*?)-->", re.DOTALL)
_HYPHEN = re.compile(r"-(?=-|$)")  # that a comment may not have
_AMPERSAND = re.compile(r"&(?!#\d+;|#x[0-9a-fA-F]+;|[\w.:-]+;)")
# UTF-32 first: its mark begins with that of UTF-16.
_MARKS = {
    codecs.BOM_UTF32_LE: "UTF-32", codecs.BOM_UTF32_BE: "UTF-32", codecs.BOM_UTF8: "UTF-8",
    codecs.BOM_UTF16_LE: "UTF-16", codecs.BOM_UTF16_BE: "UTF-16",
    b"<\0": "UTF-16-LE", b"\0<": "UTF-16-BE",
}  # fmt: skip


def read_urdf_text(path: Path) -> str:
    """Return the text of a file, see ``urdf_text``. Raises DescriptorError also if unreadable."""
    return urdf_text(read_limited(path, MAX_URDF_BYTES), path)


def urdf_text(data: bytes | str, path: Path) -> str:
    """Return the content of ``path`` as text declared as UTF-8, without a mark.

    What urdfdom reads and other parsers refuse is mended, without a change of the lines: other
    versions of XML, a NUL at the end, prefixes without a namespace, a bare ``&``, and ``--`` in
    comments.

    Raises DescriptorError: not XML, or an unknown encoding.
    """
    text = data if isinstance(data, str) else _decoded(data, path)
    text = _declared_as_utf8(text.partition("\0")[0])
    # urdfdom knows no namespaces: <robot xmlns="..."> is its <robot>.
    text = _NAMESPACE.sub(r"\1", text, count=1)
    try:
        etree.fromstring(text.encode(), _parser())
    except etree.XMLSyntaxError:
        pass
    else:
        return text
    try:
        text = _mended(text)
        etree.fromstring(text.encode(), _parser())
    except etree.XMLSyntaxError as error:
        raise DescriptorError(f"not XML: {error.msg}", path=path, line=error.lineno) from None
    return text


def xml_root(data: bytes | str, path: Path) -> Any:
    """Return the root element of the content of ``path``. Raises DescriptorError: not XML."""
    return etree.fromstring(urdf_text(data, path).encode(), _parser())


def is_xacro(root: Any) -> bool:
    """Return True for the root of a file that xacro has to expand."""
    return any(
        "ros.org/wiki/xacro" in str(element.tag) or "wiki.ros.org/xacro" in str(element.tag)
        for element in root.iter(etree.Element)
    )


def _decoded(data: bytes, path: Path) -> str:
    """Decode by the byte order mark, else by the declaration, else as UTF-8.

    Bytes that contradict the declaration are read as UTF-8, else as Latin-1: urdfdom, which does
    not decode, reads names and comments of such files as well.
    """
    mark = next((name for mark, name in _MARKS.items() if data.startswith(mark)), None)
    declared = _ENCODING.match(data[:200].decode("latin-1").lstrip())
    encoding = mark or (declared[3] if declared else "UTF-8")
    if mark is None and encoding.upper().startswith(("UTF-16", "UTF-32")):
        encoding = "UTF-8"  # the declaration itself is in single bytes
    try:
        return data.decode(encoding)
    except LookupError:
        raise DescriptorError(f"encoding {encoding!r} is unknown", path=path, line=1) from None
    except UnicodeDecodeError as error:
        if mark is not None:
            raise DescriptorError(f"is not {encoding}: {error}", path=path) from None
    with suppress(UnicodeDecodeError):
        return data.decode()
    return data.decode("latin-1")


def _declared_as_utf8(text: str) -> str:
    """Return ``text`` for readers of UTF-8: without a byte order mark, declared as UTF-8."""
    text = text.removeprefix("\ufeff")
    declaration = _DECLARATION.match(text)
    if declaration is None:
        return text
    first, rest = declaration[0], text[declaration.end() :]
    line = first.lstrip()  # urdfdom allows blank lines before it, and any version
    blank = first[: len(first) - len(line)]
    line = _ENCODING.sub(r"\1\2UTF-8\2", line) if _VERSION_1.match(line) else _UTF8
    return line + blank + rest


def _mended(text: str) -> str:
    """Return ``text`` without what urdfdom alone reads; what else is wrong with it stays."""
    text = _COMMENT.sub(lambda found: f"<!--{_HYPHEN.sub('=', found[1])}-->", text)
    text = _AMPERSAND.sub("&amp;", text)
    lenient = _parser(recover=True)
    etree.fromstring(text.encode(), lenient)
    found = (_PREFIX.match(problem.message) for problem in lenient.error_log)
    prefixes = dict.fromkeys(prefix[1] for prefix in found if prefix)
    names = "".join(f' xmlns:{prefix}="undeclared:{prefix}"' for prefix in prefixes)
    return re.sub(r"<robot\b", f"<robot{names}", text, count=1)


def _parser(*, recover: bool = False) -> etree.XMLParser:
    return etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, recover=recover)
