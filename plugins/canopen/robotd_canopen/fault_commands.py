"""Fault injection into a simulated network by lines of text."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from robotd_canopen.simulated import DriveNode, IoNode, SimulatedNetwork
from robotd_canopen.simulated.simulated_node import STOPPED

HELP = """\
NODE silence              sends and receives nothing
NODE reboot               loses its configuration and sends a boot-up message
NODE emcy CODE            sends an emergency message
NODE trip CODE            the drive stops with a fault, such as 0x3210 (over-voltage)
NODE statusword WORD      shows WORD whatever its state
NODE abort INDEX CODE     aborts every access to an object
NODE timeout INDEX        does not answer requests for an object
NODE identity VENDOR      has another vendor id
NODE late SECONDS         sends its PDOs later
NODE drop PART            loses a part of its PDOs, 0 to 1
NODE garble PART          sends a part of its frames as garbage, 0 to 1
NODE stop                 goes to the NMT state stopped by itself
NODE block                the motor does not move
NODE push ANGLE           the motor is turned by hand by ANGLE rad (or m), with the servo off
NODE input BYTE BIT 0|1   an input of an I/O module changes
NODE heal                 ends all of the above"""

Fault = Callable[[Any, list[str]], Any]
"""Called with the node and the words behind its name."""


def inject(network: SimulatedNetwork, line: str) -> str:
    """Carry out one line; return ``ok`` or an error text. Any thread."""
    number, *words = line.split()
    try:
        node = network.members[int(number)]
        fault = _FAULTS[words[0]]
        network.call(lambda: fault(node, words[1:]))
    except (KeyError, ValueError, IndexError, TypeError):
        return f"not understood: {line.strip()!r}; 'help' lists the faults"
    return "ok"


def _number(text: str) -> int:
    return int(text, 0)


def _setter(name: str, convert: Callable[[str], Any]) -> Fault:
    """Return a command that sets one of the node's faults to its first word."""
    return lambda node, words: setattr(node.faults, name, convert(words[0]))


def _flag(name: str) -> Fault:
    return lambda node, _: setattr(node.faults, name, True)


def _of_drive(node: Any) -> DriveNode:
    if not isinstance(node, DriveNode):
        raise TypeError(f"node {node.number} has no motor")
    return node


def _push(node: Any, words: list[str]) -> None:
    for drive in _of_drive(node).drives:
        drive.push(float(words[0]))


def _input(node: Any, words: list[str]) -> None:
    byte, bit, value = (int(word) for word in words)
    if not isinstance(node, IoNode):
        raise TypeError(f"node {node.number} has no inputs")
    node.set_input_bit(byte, bit, value=bool(value))


_FAULTS: dict[str, Fault] = {
    "silence": _flag("silent"),
    "reboot": lambda node, _: node.reboot(),
    "emcy": lambda node, words: node.emergency(_number(words[0])),
    "trip": lambda node, words: _of_drive(node).trip(_number(words[0])),
    "statusword": _setter("statusword", _number),
    "abort": lambda node, words: node.faults.sdo_aborts.update(
        {(_number(words[0]), None): _number(words[1])}
    ),
    "timeout": lambda node, words: node.faults.sdo_silent.add((_number(words[0]), None)),
    "identity": lambda node, words: node.values.update({(0x1018, 1): _number(words[0])}),
    "late": _setter("pdo_delay_s", float),
    "drop": _setter("pdo_drop", float),
    "garble": _setter("garbled", float),
    "stop": lambda node, _: setattr(node, "state", STOPPED),
    "block": _flag("blocked"),
    "push": _push,
    "input": _input,
    "heal": lambda node, _: node.faults.heal(),
}
