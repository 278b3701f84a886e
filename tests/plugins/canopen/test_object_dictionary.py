"""EDS files that are none."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from robotd.api import DescriptorError
from robotd_canopen.object_dictionary import MAX_BYTES, eds_path, read_eds

GENERIC = eds_path(None, None, "generic_402.eds")


@pytest.mark.parametrize(
    ("addition", "message"),
    [
        ("\nnonsense\n", r"eds:\d+: neither a section nor key=value \(value 'nonsense'\)"),
        *((f"\n{line}" * 200_000, "neither a section") for line in ("x", "x ;=1", "[x", " =1")),
        ("\n[6040]\n", r"section \[6040\] was given before, on line \d+"),
        ("\n[7000]\nObjectType=lots\n", r"eds:\d+: \[7000\] ObjectType: 'lots' is not a number"),
        (";" * MAX_BYTES, "larger than the limit of 2_000_000 bytes"),
        ("\udcff", "neither a section nor key=value \\(value 'ÿ'"),
    ],
)
def test_a_wrong_file_is_rejected_at_once(tmp_path: Path, addition: str, message: str) -> None:
    path = tmp_path / "drive.eds"
    path.write_bytes(GENERIC.read_bytes() + addition.encode(errors="surrogateescape"))
    begin_s = time.process_time()
    with pytest.raises(DescriptorError, match=message) as caught:
        read_eds(path, 5)
    assert time.process_time() - begin_s < 2.0
    assert len(str(caught.value)) < 1000
