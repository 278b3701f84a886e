"""The URDF that the robot's descriptor names."""

from __future__ import annotations

from robotd.descriptor.files import read_limited
from robotd.export.export_input import ExportInput

MAX_BYTES = 8_000_000


def urdf(source: ExportInput) -> str:
    """Return the text of the file. Raises DescriptorError: missing or not UTF-8."""
    path = source.descriptor.urdf
    if path is None:
        raise source.rejection(f"{source.descriptor.name} has no urdf")
    try:
        return read_limited(path, MAX_BYTES).decode()
    except UnicodeDecodeError as error:
        raise source.rejection(f"{path} is not UTF-8: {error.reason}") from None
