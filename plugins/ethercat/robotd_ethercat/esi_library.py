"""ESI files of a folder, looked through for the devices on a bus."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from pathlib import Path

from robotd.api import DescriptorError, read_limited
from robotd_ethercat.esi_device import EsiDevice
from robotd_ethercat.esi_reader import MAX_BYTES, read_esi

MAX_FILES = 5000
MAX_NAMED = 20  # products in an error


class EsiLibrary:
    """Devices by vendor, product and revision.

    Attributes:
        problems: files that cannot be read, which are left out.
    """

    def __init__(self, path: Path, wanted: Collection[tuple[int, int]]) -> None:
        """Read the devices ``wanted``, as (vendor, product). Raises DescriptorError."""
        self.problems: list[str] = []
        self._devices: list[EsiDevice] = []
        for file in _files(path):
            try:
                if _mentions(read_limited(file, MAX_BYTES), wanted):
                    self._devices += read_esi(file, wanted)
            except DescriptorError as error:
                self.problems.append(str(error))

    def find(self, vendor: int, product: int, revision: int) -> EsiDevice | None:
        """Return the device in this revision, the newest before it, or the oldest."""
        found = [one for one in self._devices if (one.vendor, one.product) == (vendor, product)]
        found.sort(key=lambda one: one.revision)
        earlier = [one for one in found if one.revision <= revision]
        return earlier[-1] if earlier else found[0] if found else None


def of_products(
    devices: Sequence[EsiDevice], products: Iterable[int], path: Path
) -> list[EsiDevice]:
    """Return the newest revision of each product. Raises DescriptorError: a product is missing."""
    newest = {device.product: device for device in sorted(devices, key=lambda one: one.revision)}
    try:
        return [newest[product] for product in products]
    except KeyError as error:
        known = ", ".join(f"0x{product:08X}" for product in sorted(newest)[:MAX_NAMED]) or "none"
        what = f"has no product 0x{error.args[0]:08X} (available: {known})"
        raise DescriptorError(what, path=path) from None


def _files(path: Path) -> Iterator[Path]:
    if path.is_file():
        yield path
        return
    try:
        files = sorted(file for file in path.iterdir() if file.suffix.lower() == ".xml")
    except OSError as error:
        raise DescriptorError(f"cannot be read: {error.strerror}", path=path) from None
    if len(files) > MAX_FILES:
        what = f"has {len(files)} XML files, the limit is {MAX_FILES}"
        raise DescriptorError(what, path=path)
    yield from files


def _mentions(data: bytes, wanted: Collection[tuple[int, int]]) -> bool:
    """Return False for a file without any of the product codes."""
    if b"\0" in data[:200]:  # UTF-16
        return True
    text = data.lower()
    return any(b"%x" % product in text or b"%d" % product in text for _, product in wanted)
