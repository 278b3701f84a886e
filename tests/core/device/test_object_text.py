"""Values of objects as text."""

from __future__ import annotations

import pytest

from robotd.device.fieldbus import object_text


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (b"\x37\x02", "37 02 (0x0237, 567)"),
        (b"A", "41 (0x41, 65)"),
        (b"", "(empty)"),
        (b"CR3", "43 52 33 'CR3'"),
        (b"\xfb\xff\xff\xff", "fb ff ff ff (0xFFFFFFFB, 4294967291)"),
    ],
)
def test_an_object_is_shown_as_bytes_number_and_printable_text(data: bytes, text: str) -> None:
    assert object_text(data) == text
