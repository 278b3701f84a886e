"""Fault injection into a line of slaves by lines of text."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from robotd_ethercat.simulated.line import Line
from robotd_ethercat.simulated.simulated_slave import Slave

HELP = """\
SLAVE: place on the cable, 0 is the first.
SLAVE off | on                    power; slaves behind it cannot be reached either
SLAVE cut | join                  cable before the slave; one more than the last: its other end
SLAVE loss PART                   loses a part of the frames before the slave, 0 to 1
SLAVE corrupt PART                corrupts a part of the frames before the slave, 0 to 1
SLAVE identity VENDOR [PRODUCT]   has another identity
SLAVE al CODE                     falls to SafeOp with an AL status code, such as 0x1A
SLAVE mailbox silent | healthy    does not answer in the mailbox
SLAVE timeout INDEX               does not answer SDO requests for an object
SLAVE abort INDEX CODE            aborts each SDO access to an object
SLAVE unpadded                    answers complete access with one byte for subindex 0
SLAVE emcy CODE [REGISTER]        sends an emergency; CODE 0: an error is gone, REGISTER has others
SLAVE drift PPM                   rate error of its clock
SLAVE sync0 off | on              stops SYNC0
SLAVE state                       answers AL state and AL status code
SLAVE trip [CODE [AXIS]]          drive: fault, such as 0x3210 (over-voltage)
SLAVE statusword WORD             drive: shows WORD whatever its state
SLAVE mode NUMBER                 drive: shows this mode of operation, such as 4
SLAVE block                       drive: the motor does not move
SLAVE push ANGLE [AXIS]           drive: turns the motor by ANGLE rad (or m), with the servo off
SLAVE press BIT 0|1 [AXIS]        drive: switch, bit of object 0x60FD
SLAVE position | torque [AXIS]    drive: answers rad (or m), N·m (or N)
SLAVE input BYTE BIT 0|1          I/O module: an input changes
SLAVE output BYTE BIT             I/O module: answers an output, 0 or 1
SLAVE heal | all heal             ends faults of power, cable, mailbox, objects, clock, motor"""


@dataclass
class Target:
    """Slave of a command."""

    line: Line
    number: int

    @property
    def slave(self) -> Slave:
        return self.line.slaves[self.number]

    def power(self, on: bool) -> None:
        """Switch the power of the slave."""
        self.line.power(self.number, on, time.monotonic_ns())

    def change_cable(self, **values: float) -> None:
        """Change ``cut``, ``loss`` or ``corruption`` of the cable before the slave."""
        for name, value in values.items():
            setattr(self.line.cables[self.number], name, value)
        self.line.update()

    def change_identity(self, vendor: int, product: int | None = None) -> None:
        """Let the slave have another identity."""
        identity = replace(self.slave.identity, vendor_id=vendor)
        if product is not None:
            identity = replace(identity, product_code=product)
        self.slave.change_identity(identity)

    def drift(self, ppm: float) -> None:
        """Set the rate error of the slave's clock."""
        self.slave.controller.clock.set_drift(ppm * 1e-6, time.monotonic_ns())

    def heal(self) -> None:
        """End faults of power, cable, mailbox, objects, clock and motor."""
        slave = self.slave
        slave.faults.heal()
        slave.mailbox.silent = False
        slave.change_identity(slave.identity)
        self.drift(0.0)
        slave.controller.clock.sync0 = True
        self.change_cable(cut=False, loss=0.0, corruption=0.0)
        self.power(True)


Fault = Callable[[Target, list[str]], str | None]


def inject(line: Line, text: str) -> str:
    """Carry out one line of text; return ``ok``, a value, or an error text.

    Only in the thread of the line.
    """
    try:
        place, name, *words = text.split()
        if place == "all":
            answers = [_FAULTS[name](Target(line, n), words) for n in range(len(line.slaves))]
            return answers[0] or "ok"
        target = Target(line, int(place))
        own = target.slave.commands if target.number < len(line.slaves) else {}
        if name in own:
            return own[name](words) or "ok"
        return _FAULTS[name](target, words) or "ok"
    except (KeyError, ValueError, IndexError, TypeError):
        return f"not understood: {text.strip()!r}; 'help' lists the faults"


def _switch(words: list[str], on: str, off: str) -> bool:
    return (on, off).index(words[0]) == 0


def _number(text: str) -> int:
    return int(text, 0)


_FAULTS: dict[str, Fault] = {
    "off": lambda at, _: at.power(False),
    "on": lambda at, _: at.power(True),
    "cut": lambda at, _: at.change_cable(cut=True),
    "join": lambda at, _: at.change_cable(cut=False),
    "loss": lambda at, words: at.change_cable(loss=float(words[0])),
    "corrupt": lambda at, words: at.change_cable(corruption=float(words[0])),
    "identity": lambda at, words: at.change_identity(*map(_number, words)),
    "al": lambda at, words: at.slave.al.fail(_number(words[0])),
    "mailbox": lambda at, words: setattr(
        at.slave.mailbox, "silent", _switch(words, "silent", "healthy")
    ),
    "timeout": lambda at, words: at.slave.faults.unanswered.add((_number(words[0]), None)),
    "abort": lambda at, words: at.slave.faults.aborts.update(
        {(_number(words[0]), None): _number(words[1])}
    ),
    "unpadded": lambda at, _: setattr(at.slave.faults, "unpadded", True),
    "emcy": lambda at, words: at.slave.emergency(
        _number(words[0]), _number(words[1]) if words[1:] else None
    ),
    "drift": lambda at, words: at.drift(float(words[0])),
    "sync0": lambda at, words: setattr(
        at.slave.controller.clock, "sync0", _switch(words, "on", "off")
    ),
    "state": lambda at, _: f"{at.slave.al.state.name} 0x{at.slave.al.code:04X}",
    "heal": lambda at, _: at.heal(),
}
