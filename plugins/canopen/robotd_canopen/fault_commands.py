"""Fault injection into a simulated network by lines of text."""

from __future__ import annotations

from collections.abc import Callable

from robotd_canopen.simulated import DriveNode, IoNode, SimulatedNetwork, SimulatedNode
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

Fault = Callable[[SimulatedNode, list[str]], None]


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


def _number(words: list[str]) -> int:
    return int(words[0], 0)


def _silence(node: SimulatedNode, words: list[str]) -> None:
    node.faults.silent = True


def _reboot(node: SimulatedNode, words: list[str]) -> None:
    node.reboot()


def _emcy(node: SimulatedNode, words: list[str]) -> None:
    node.emergency(_number(words))


def _trip(node: SimulatedNode, words: list[str]) -> None:
    if isinstance(node, DriveNode):
        node.trip(_number(words))


def _statusword(node: SimulatedNode, words: list[str]) -> None:
    node.faults.statusword = _number(words)


def _abort(node: SimulatedNode, words: list[str]) -> None:
    node.faults.sdo_aborts[_number(words), None] = int(words[1], 0)


def _timeout(node: SimulatedNode, words: list[str]) -> None:
    node.faults.sdo_silent.add((_number(words), None))


def _identity(node: SimulatedNode, words: list[str]) -> None:
    node.values[0x1018, 1] = _number(words)


def _late(node: SimulatedNode, words: list[str]) -> None:
    node.faults.pdo_delay_s = float(words[0])


def _drop(node: SimulatedNode, words: list[str]) -> None:
    node.faults.pdo_drop = float(words[0])


def _garble(node: SimulatedNode, words: list[str]) -> None:
    node.faults.garbled = float(words[0])


def _stop(node: SimulatedNode, words: list[str]) -> None:
    node.state = STOPPED


def _block(node: SimulatedNode, words: list[str]) -> None:
    node.faults.blocked = True


def _push(node: SimulatedNode, words: list[str]) -> None:
    if not isinstance(node, DriveNode):
        raise TypeError(f"node {node.number} has no motor")
    for drive in node.drives:
        drive.push(float(words[0]))


def _input(node: SimulatedNode, words: list[str]) -> None:
    byte, bit, value = (int(word) for word in words)
    if not isinstance(node, IoNode):
        raise TypeError(f"node {node.number} has no inputs")
    node.set_input_bit(byte, bit, value=bool(value))


def _heal(node: SimulatedNode, words: list[str]) -> None:
    node.faults.heal()


_FAULTS: dict[str, Fault] = {
    "silence": _silence,
    "reboot": _reboot,
    "emcy": _emcy,
    "trip": _trip,
    "statusword": _statusword,
    "abort": _abort,
    "timeout": _timeout,
    "identity": _identity,
    "late": _late,
    "drop": _drop,
    "garble": _garble,
    "stop": _stop,
    "block": _block,
    "push": _push,
    "input": _input,
    "heal": _heal,
}
