"""Process data of one slave as integers: decoded inputs, and outputs to encode."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from itertools import count

from robotd.api import OperationError
from robotd_ethercat.mapping import Entry, Pdo
from robotd_ethercat.object_types import entry_format

_KEY = tuple[int, int]  # index and subindex


class SlaveImage:
    """Inputs and outputs of a drive, by the mapping that it has.

    The control loop takes inputs and packs outputs; a worker changes the layout while no process
    data are exchanged.

    Attributes:
        inputs: values received last, in the order of the mapping.
        outputs: values to send, in the order of the mapping.
        input_slots, output_slots: (index, subindex) → place in these.
    """

    def __init__(self) -> None:
        self.inputs: Sequence[int] = ()
        self.outputs: list[int] = []
        self.input_slots: dict[_KEY, int] = {}
        self.output_slots: dict[_KEY, int] = {}
        self._input = self._output = struct.Struct("")

    @property
    def input_size(self) -> int:
        """Bytes of the inputs."""
        return self._input.size

    @property
    def output_size(self) -> int:
        """Bytes of the outputs."""
        return self._output.size

    def set_layout(self, rx_pdos: Sequence[Pdo], tx_pdos: Sequence[Pdo]) -> None:
        """Take the mapping; all values are 0.

        Raises OperationError for an object that is misaligned, or mapped twice.
        """
        self._output, self.output_slots = _layout(rx_pdos)
        self._input, self.input_slots = _layout(tx_pdos)
        self.outputs = [0] * len(self.output_slots)
        self.inputs = (0,) * len(self.input_slots)

    def take(self, data: bytes) -> None:
        """Control loop: decode ``data``, ``input_size`` bytes."""
        self.inputs = self._input.unpack(data)

    def pack(self) -> bytes:
        """Control loop: encode the outputs, ``output_size`` bytes."""
        return self._output.pack(*self.outputs)


def _layout(pdos: Sequence[Pdo]) -> tuple[struct.Struct, dict[_KEY, int]]:
    """Format and slots; gaps and objects of other sizes are skipped in whole bytes."""
    formats, slots, numbers, skipped_bits = ["<"], dict[_KEY, int](), count(), 0
    for pdo in pdos:
        for entry in pdo.entries:
            code = entry_format(entry.index, entry.sub, entry.bits) if entry.index else None
            if code is None:
                skipped_bits += entry.bits
                continue
            key = entry.index, entry.sub
            if key in slots:
                raise OperationError(f"PDO 0x{pdo.index:04X}: {entry} is in another PDO, too")
            formats.append(_gap(skipped_bits, pdo, entry) + code)
            skipped_bits = 0
            slots[key] = next(numbers)
    formats.append("x" * ((skipped_bits + 7) // 8))
    return struct.Struct("".join(formats)), slots


def _gap(bits: int, pdo: Pdo, entry: Entry) -> str:
    if bits % 8:
        raise OperationError(
            f"PDO 0x{pdo.index:04X}: {entry} begins inside a byte, after {bits % 8} bit;"
            " map a gap before it"
        )
    return "x" * (bits // 8)
