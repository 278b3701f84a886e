"""EEPROM interface registers of a slave controller, with an SII image behind them."""

from __future__ import annotations

from robotd_ethercat.simulated import registers as reg

_READ, _WRITE, _RELOAD = 1, 2, 4
_WRITE_ENABLE, _EIGHT_BYTES, _ADDRESS_BYTES = 0x0001, 0x0040, 0x0080
_COMMAND_ERROR = 0x2000
_WORDS = 0x1_0000


class EepromInterface:
    """Word access by the registers 0x0500 to 0x050F; 8 bytes are read at a time."""

    def __init__(self, memory: bytearray, image: bytearray) -> None:
        self._memory = memory
        self.image = image
        self._status(0)

    def command(self) -> None:
        """Carry out the command in the control register."""
        memory = self._memory
        control = int.from_bytes(memory[reg.EEPROM_CONTROL : reg.EEPROM_CONTROL + 2], "little")
        word = int.from_bytes(memory[reg.EEPROM_ADDRESS : reg.EEPROM_ADDRESS + 4], "little")
        command = control >> 8 & 7
        error = 0
        if command == _READ:
            data = bytes(self.image[2 * word : 2 * word + 8]) if word < _WORDS else b""
            memory[reg.EEPROM_DATA : reg.EEPROM_DATA + 8] = data.ljust(8, b"\xff")
        elif command == _WRITE and control & _WRITE_ENABLE and 2 * word + 2 <= len(self.image):
            self.image[2 * word : 2 * word + 2] = memory[reg.EEPROM_DATA : reg.EEPROM_DATA + 2]
        elif command not in (0, _RELOAD):
            error = _COMMAND_ERROR
        self._status(error)

    def _status(self, error: int) -> None:
        status = _EIGHT_BYTES | _ADDRESS_BYTES | error
        self._memory[reg.EEPROM_CONTROL : reg.EEPROM_CONTROL + 2] = status.to_bytes(2, "little")
