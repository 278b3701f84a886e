"""Check of the named bits of a descriptor against the I/O images of a device."""

from __future__ import annotations

from collections.abc import Iterator

from robotd.descriptor import RobotDescriptor
from robotd.device.io import Io
from robotd.errors import DescriptorError


def check_names(descriptor: RobotDescriptor, io: Io) -> None:
    """Raise DescriptorError for every named bit that the device does not have."""
    if problems := [*_problems(descriptor, io)]:
        raise DescriptorError.join(problems)


def _problems(descriptor: RobotDescriptor, io: Io) -> Iterator[DescriptorError]:
    for key, names, size in zip(
        ("inputs", "outputs"), (io.inputs, io.outputs), io.sizes, strict=True
    ):
        for name, address in names.items():
            if address.byte >= size:
                last = f"the last byte is {size - 1}" if size else f"the device has no {key}"
                what = f"{address} is outside the image of {key}: {last}"
                node = descriptor.tree.find((key, name)) if descriptor.tree else None
                path, line = (node.path, node.line) if node else (None, None)
                yield DescriptorError(what, path=path, line=line, key=f"{key}.{name}")
