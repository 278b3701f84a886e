"""The robot's URDF, as the descriptor names it."""

from __future__ import annotations

from robotd.descriptor.files import read_limited
from robotd.export.subject import Subject

MAX_BYTES = 8_000_000


def urdf(subject: Subject) -> str:
    """The text of the file. Raises DescriptorError where there is none, or it is not UTF-8."""
    path = subject.descriptor.urdf
    if path is None:
        raise subject.refusal(f"{subject.descriptor.name} has no urdf")
    try:
        return read_limited(path, MAX_BYTES).decode()
    except UnicodeDecodeError as error:
        raise subject.refusal(f"{path} is not UTF-8: {error.reason}") from None
