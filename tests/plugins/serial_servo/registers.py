"""Register table of a simulated servo: persistent and volatile memory."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Register:
    """One entry of a table.

    sign_bit: bit that holds the sign of a sign-and-magnitude value; None: unsigned, or two's
    complement if ``signed``.
    """

    address: int
    size: int
    name: str
    default: int = 0
    persistent: bool = False
    writable: bool = True
    sign_bit: int | None = None
    signed: bool = False
    lowest: int | None = None
    highest: int | None = None

    def encode(self, value: int) -> bytes:
        if self.sign_bit is not None:
            magnitude = min(abs(value), (1 << self.sign_bit) - 1)
            value = magnitude | (1 << self.sign_bit if value < 0 else 0)
        return (value & ((1 << 8 * self.size) - 1)).to_bytes(self.size, "little")

    def decode(self, data: bytes) -> int:
        value = int.from_bytes(data, "little", signed=self.signed)
        if self.sign_bit is None:
            return value
        magnitude = value & ((1 << self.sign_bit) - 1)
        return -magnitude if value >> self.sign_bit & 1 else magnitude


class Registers:
    """Memory of one servo. ``saved`` survives a loss of power, ``memory`` does not."""

    def __init__(self, table: Iterable[Register], size: int) -> None:
        self.by_name = {register.name: register for register in table}
        self._at = {
            register.address + byte: register
            for register in self.by_name.values()
            for byte in range(register.size)
        }
        self.saved = bytearray(size)
        self.memory = bytearray(size)
        self.values: dict[str, int] = {}
        """Decoded memory, by name, to be read only."""
        self.restore_factory_settings()

    def restore_factory_settings(self) -> None:
        for register in self.by_name.values():
            self.set(register.name, register.default)

    def load(self) -> None:
        """Set the memory as after power-on: saved values and defaults of volatile registers."""
        for register in self.by_name.values():
            place = slice(register.address, register.address + register.size)
            value = register.decode(self.saved[place]) if register.persistent else register.default
            self._put(register, value)

    def get(self, name: str) -> int:
        return self.values[name]

    def set(self, name: str, value: int) -> None:
        """Set a register from inside, read-only ones too; persistent ones are saved."""
        register = self.by_name[name]
        self._put(register, value)
        if register.persistent:
            place = slice(register.address, register.address + register.size)
            self.saved[place] = self.memory[place]

    def _put(self, register: Register, value: int) -> None:
        data = register.encode(value)
        self.memory[register.address : register.address + register.size] = data
        self.values[register.name] = register.decode(data)

    def store(self, register: Register, address: int, data: bytes, *, save: bool) -> None:
        """Store those bytes of a block at ``address`` that belong to ``register``."""
        first = max(address, register.address)
        end = min(address + len(data), register.address + register.size)
        self.memory[first:end] = data[first - address : end - address]
        if save:
            self.saved[first:end] = self.memory[first:end]
        place = slice(register.address, register.address + register.size)
        self.values[register.name] = register.decode(self.memory[place])

    def at(self, address: int) -> Register | None:
        """Return the register that covers ``address``; None: undefined."""
        return self._at.get(address)

    def touched(self, address: int, count: int) -> list[Register]:
        """Return the registers of a block of ``count`` bytes, each once."""
        found = (self._at.get(place) for place in range(address, address + count))
        return list(dict.fromkeys(register for register in found if register is not None))
