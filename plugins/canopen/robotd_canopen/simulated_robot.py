"""Simulated network with the nodes of a descriptor section, and faults by lines of text."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable
from typing import Any

import can

from robotd.api import ConnectError, RobotDescriptor
from robotd_canopen.object_dictionary import GENERIC_DRIVE, GENERIC_IO, eds_path
from robotd_canopen.options import AxisOptions, CanopenOptions
from robotd_canopen.simulated import DriveNode, IoNode, SimulatedNetwork, SimulatedNode
from robotd_canopen.simulated.simulated_node import STOPPED
from robotd_cia402.options import Identity
from robotd_cia402.simulated import Drive, Motors
from robotd_cia402.simulated_axis import drive_model, initial_positions, joint_weights

HELP = """\
NODE silence [0]          sends and receives nothing; 0 ends it
NODE reboot               loses its configuration and sends a boot-up message
NODE emcy CODE [REGISTER] sends an emergency; CODE 0: an error is gone, REGISTER has others
NODE trip CODE [AXIS]     the drive stops with a fault, such as 0x3210 (over-voltage)
NODE statusword WORD      shows WORD whatever its state
NODE mode NUMBER          shows this mode of operation, such as 4 (profile torque)
NODE abort INDEX CODE     aborts every access to an object
NODE timeout INDEX        does not answer requests for an object
NODE identity VENDOR      has another vendor id
NODE late SECONDS         sends its PDOs later
NODE drop PART            loses a part of its PDOs, 0 to 1
NODE garble PART          sends a part of its frames as garbage, 0 to 1
NODE stop                 goes to the NMT state stopped by itself
NODE block                the motor does not move
NODE push ANGLE [AXIS]    the motor is turned by hand by ANGLE rad (or m), with the servo off
NODE press BIT 0|1 [AXIS] a switch of the drive, bit of object 0x60FD
NODE position [AXIS]      answers rad (or m)
NODE torque [AXIS]        answers N·m (or N)
NODE input BYTE BIT 0|1   an input of an I/O module changes
NODE output BYTE BIT      answers an output of an I/O module, 0 or 1
NODE heal                 ends all of the above
AXIS: of a drive with several, from 0; without it all of them, or the first. NODE: or "all"."""

Fault = Callable[[Any, list[str]], Any]
"""Called with the node and the words behind its name; returns an answer, or None."""


class Simulation:
    """The robot's nodes in this process, for the option ``simulated``. Worker threads."""

    def __init__(self, robot: RobotDescriptor, options: CanopenOptions) -> None:
        self._robot, self._options = robot, options
        self._network: SimulatedNetwork | None = None

    def start(self) -> None:
        """Power on; no effect on a running network."""
        if self._network is None:
            self._network = simulated_network(self._robot, self._options)
            self._network.start()

    def stop(self) -> None:
        """Power off. Twice is not an error."""
        network, self._network = self._network, None
        if network is not None:
            network.stop()

    def inject(self, line: str) -> str:
        """Inject a fault. Raises ConnectError while powered off, ValueError."""
        answer = inject(self.network, line)
        if answer.startswith("not understood"):
            raise ValueError(answer)
        return answer

    @property
    def network(self) -> SimulatedNetwork:
        """Raises ConnectError while powered off."""
        if self._network is None:
            raise ConnectError("the simulated nodes are not running")
        return self._network


def simulated_network(robot: RobotDescriptor, options: CanopenOptions) -> SimulatedNetwork:
    """Make the nodes of the section on a bus of their own, not started."""
    folder = robot.path.parent if robot.path is not None else None
    initial, weights = initial_positions(options.axes, robot), joint_weights(options.axes, robot)
    machine = Motors(initial, time.monotonic_ns(), weights)
    rated = {joint.axis: joint.rated_effort for joint in robot.joints}
    by_node: dict[int, list[tuple[int, AxisOptions]]] = defaultdict(list)
    for motor, axis in enumerate(options.axes):
        by_node[axis.node].append((motor, axis))
    nodes: list[SimulatedNode] = []
    for number, axes in by_node.items():
        first = axes[0][1]
        models = [drive_model(motor, axis, rated.get(axis.axis)) for motor, axis in axes]
        eds = eds_path(first.eds, folder, GENERIC_DRIVE)
        nodes.append(DriveNode(number, eds, machine, models, _identity(first.identity)))
    for module in options.io:
        eds = eds_path(module.eds, folder, GENERIC_IO)
        nodes.append(IoNode(module.node, eds, _identity(module.identity)))
    bus = can.Bus(
        channel=options.bus.channel,
        interface=options.bus.interface,
        bitrate=options.bus.bitrate,
        **options.bus.options,
    )
    priority = max(0, robot.cycle.realtime_priority - 2)  # below the threads that use it
    return SimulatedNetwork(bus, nodes, machine, realtime_priority=priority)


def _identity(identity: Identity) -> dict[int, int]:
    parts = (identity.vendor_id, identity.product_code, identity.revision, identity.serial)
    return {sub: value for sub, value in enumerate(parts, 1) if value is not None}


def inject(network: SimulatedNetwork, line: str) -> str:
    """Carry out one line; return ``ok``, a value, or an error text. Any thread."""
    answers: list[object] = []
    try:
        place, name, *words = line.split()
        members = network.members
        nodes = list(members.values()) if place == "all" else [members[int(place)]]
        fault = _FAULTS[name]
        network.call(lambda: answers.extend(fault(node, words) for node in nodes))
    except (KeyError, ValueError, IndexError, TypeError):
        return f"not understood: {line.strip()!r}; 'help' lists the faults"
    return "ok" if answers[0] is None else str(answers[0])


def _number(text: str) -> int:
    return int(text, 0)


def _setter(name: str, convert: Callable[[str], Any]) -> Fault:
    """Return a command that sets one of the node's faults to its first word."""
    return lambda node, words: setattr(node.faults, name, convert(words[0]))


def _drives(node: Any, words: list[str]) -> list[Drive]:
    """Return the axis that ``words`` name; without a word all."""
    if not isinstance(node, DriveNode):
        raise TypeError(f"node {node.number} has no motor")
    return [node.drives[int(words[0])]] if words else node.drives


def _trip(node: Any, words: list[str]) -> None:
    for drive in _drives(node, words[1:]):
        drive.trip(_number(words[0]))


def _push(node: Any, words: list[str]) -> None:
    for drive in _drives(node, words[1:]):
        drive.push(float(words[0]))


def _module(node: Any) -> IoNode:
    if not isinstance(node, IoNode):
        raise TypeError(f"node {node.number} has no inputs and outputs")
    return node


_FAULTS: dict[str, Fault] = {
    "silence": lambda node, words: setattr(node.faults, "silent", words != ["0"]),
    "reboot": lambda node, _: node.reboot(),
    "emcy": lambda node, words: node.emergency(*map(_number, words[:2])),
    "trip": _trip,
    "statusword": _setter("statusword", _number),
    "mode": _setter("mode", _number),
    "abort": lambda node, words: node.faults.aborts.update(
        {(_number(words[0]), None): _number(words[1])}
    ),
    "timeout": lambda node, words: node.faults.unanswered.add((_number(words[0]), None)),
    "identity": lambda node, words: node.values.update({(0x1018, 1): _number(words[0])}),
    "late": _setter("pdo_delay_s", float),
    "drop": _setter("pdo_drop", float),
    "garble": _setter("garbled", float),
    "stop": lambda node, _: setattr(node, "state", STOPPED),
    "block": lambda node, _: setattr(node.faults, "blocked", True),
    "push": _push,
    "press": lambda node, words: _drives(node, words[2:])[0].press(
        int(words[0]), pressed=words[1] == "1"
    ),
    "position": lambda node, words: _drives(node, words)[0].position,
    "torque": lambda node, words: _drives(node, words)[0].torque,
    "input": lambda node, words: _module(node).set_input_bit(
        int(words[0]), int(words[1]), value=words[2] == "1"
    ),
    "output": lambda node, words: _module(node).outputs[int(words[0])] >> int(words[1]) & 1,
    "heal": lambda node, _: node.faults.heal(),
}
