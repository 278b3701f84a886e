"""Text of a URDF, decoded by its byte order mark or its XML declaration."""

from __future__ import annotations

import codecs
import re
from pathlib import Path
from typing import Any

from lxml import etree

from robotd.descriptor.files import read_limited
from robotd.errors import DescriptorError

MAX_BYTES = 8_000_000

_DECLARED = re.compile(r"""(<\?xml[^>]*?encoding\s*=\s*)(["'])[^"']*\2""")


def read_urdf_text(path: Path) -> str:
    """Return the text of a file, declared as UTF-8 where it declares an encoding.

    Raises DescriptorError: it cannot be read, or is not XML.
    """
    data = read_limited(path, MAX_BYTES)
    marked = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    declared = xml_root(data, path).getroottree().docinfo.encoding
    encoding = "UTF-16" if marked else declared or "UTF-8"
    try:
        text = data.decode(encoding)
    except (LookupError, UnicodeDecodeError) as error:
        raise DescriptorError(f"is not {encoding}: {error}", path=path) from None
    return declared_as_utf8(text)


def declared_as_utf8(text: str) -> str:
    """Return ``text`` for readers of UTF-8: without a byte order mark, declared as UTF-8."""
    text = text.removeprefix("\ufeff")
    declaration = _DECLARED.match(text)
    if declaration is None:
        return text
    head, quote = declaration.groups()
    return f"{head}{quote}UTF-8{quote}{text[declaration.end() :]}"


def xml_root(data: bytes | str, path: Path) -> Any:
    """Return the root element of the content of ``path``. Raises DescriptorError: not XML."""
    if isinstance(data, str):
        data = declared_as_utf8(data).encode()
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False)
    try:
        return etree.fromstring(data, parser)
    except etree.XMLSyntaxError as error:
        raise DescriptorError(f"not XML: {error.msg}", path=path, line=error.lineno) from None
