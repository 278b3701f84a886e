"""Digital inputs and outputs: 16 each of the cabinet, terminal 1 is bit 0 of byte 0; the tool's."""

from __future__ import annotations

from robotd.api import InvalidArgument, IoDriver
from robotd_dobot.device import DobotDevice
from robotd_dobot.tool_terminals import TERMINALS

CABINET = bytes(2)
TOOL_BYTE = len(CABINET)


class DobotIo(IoDriver):
    """Reads answer from what has been received; each output bit is a command of its own."""

    def __init__(self, device: DobotDevice) -> None:
        self._device = device

    @property
    def input_bytes(self) -> int:
        return len(CABINET) + self._device.options.tool_io

    @property
    def output_bytes(self) -> int:
        return self.input_bytes

    def read_inputs(self, byte: int, length: int) -> bytes:
        values, tool = self._device.feedback, self._device.tool
        cabinet = values.inputs[:TOOL_BYTE] if values else CABINET
        return (cabinet + bytes([tool.inputs if tool else 0]))[byte : byte + length]

    def read_outputs(self, byte: int, length: int) -> bytes:
        values, tool = self._device.feedback, self._device.tool
        cabinet = values.outputs[:TOOL_BYTE] if values else CABINET
        return (cabinet + bytes([tool.outputs if tool else 0]))[byte : byte + length]

    def write_outputs(self, byte: int, data: bytes) -> None:
        tool = data[TOOL_BYTE - byte :] if byte <= TOOL_BYTE else b""
        if tool and tool[0] >> TERMINALS:
            raise InvalidArgument(_no_terminal(f"{tool[0]:#04x}"))
        for index, value in enumerate(data, byte):
            for bit in range(TERMINALS if index == TOOL_BYTE else 8):
                self.write_output_bit(index, bit, bool(value >> bit & 1))

    def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
        link = self._device.link
        if byte != TOOL_BYTE:
            link.command(link.dialect.set_output, 8 * byte + bit + 1, value)
        elif bit >= TERMINALS:
            raise InvalidArgument(_no_terminal(f"bit {bit}"))
        else:
            link.command(link.dialect.set_tool_output, bit + 1, value)
            if link.tool:
                link.tool.note_output(bit, value)


def _no_terminal(what: str) -> str:
    return f"output byte {TOOL_BYTE}, {what}: the tool has bits 0 and 1"
