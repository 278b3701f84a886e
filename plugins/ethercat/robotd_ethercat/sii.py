"""Process data in the SII EEPROM of a slave (ETG.1000.6, table 18; ETG.2010)."""

from __future__ import annotations

from collections.abc import Callable, Iterator

_FIRST_CATEGORY = 0x40  # word address
_TX_PDO, _RX_PDO, _END = 50, 51, 0xFFFF
_MAX_WORDS = 0x2000
_HEADER_BYTES, _ENTRY_BYTES = 8, 8
_BITS, _SYNC_MANAGER, _ENTRIES, _UNUSED = 5, 3, 2, 0xFF

ReadWords = Callable[[int], int]
"""Reads 32 bits at a word address."""


def process_data_sizes(read: ReadWords) -> tuple[int, int]:
    """Return the bytes of outputs and inputs of the PDOs that are assigned by default."""
    bits = {_RX_PDO: 0, _TX_PDO: 0}
    for kind, data in _categories(read):
        if kind in bits:
            bits[kind] += _assigned_bits(data)
    return (bits[_RX_PDO] + 7) // 8, (bits[_TX_PDO] + 7) // 8


def _categories(read: ReadWords) -> Iterator[tuple[int, bytes]]:
    """Yield type and contents of the PDO categories."""
    word = _FIRST_CATEGORY
    while word < _MAX_WORDS:
        header = read(word)
        kind, words = header & 0xFFFF, header >> 16
        if kind == _END:
            return
        if kind in (_TX_PDO, _RX_PDO):
            yield (
                kind,
                b"".join(
                    read(word + 2 + offset).to_bytes(4, "little") for offset in range(0, words, 2)
                )[: 2 * words],
            )
        word += 2 + words


def _assigned_bits(data: bytes) -> int:
    """Sum the entries of the PDOs in one category that have a sync manager."""
    bits = position = 0
    while position + _HEADER_BYTES <= len(data):
        entries, assigned = data[position + _ENTRIES], data[position + _SYNC_MANAGER] != _UNUSED
        first = position + _HEADER_BYTES
        position = first + entries * _ENTRY_BYTES
        if assigned:
            bits += sum(data[first + _BITS : position : _ENTRY_BYTES])
    return bits
