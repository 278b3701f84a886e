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
SLAVE emcy CODE                   sends an emergency
SLAVE drift PPM                   rate error of its clock
SLAVE sync0 off | on              stops SYNC0
SLAVE state                       answers AL state and AL status code
SLAVE trip [CODE [AXIS]]          drive: fault, such as 0x3210 (over-voltage)
SLAVE statusword WORD             drive: shows WORD whatever its state
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


def _off(target: Target, words: list[str]) -> None:
    target.line.power(target.number, False, time.monotonic_ns())


def _on(target: Target, words: list[str]) -> None:
    target.line.power(target.number, True, time.monotonic_ns())


def _cut(target: Target, words: list[str]) -> None:
    target.line.cables[target.number].cut = True
    target.line.update()


def _join(target: Target, words: list[str]) -> None:
    target.line.cables[target.number].cut = False
    target.line.update()


def _loss(target: Target, words: list[str]) -> None:
    target.line.cables[target.number].loss = float(words[0])
    target.line.update()


def _corrupt(target: Target, words: list[str]) -> None:
    target.line.cables[target.number].corruption = float(words[0])
    target.line.update()


def _identity(target: Target, words: list[str]) -> None:
    vendor, *product = (int(word, 0) for word in words)
    identity = replace(target.slave.identity, vendor_id=vendor)
    if product:
        identity = replace(identity, product_code=product[0])
    target.slave.change_identity(identity)


def _al(target: Target, words: list[str]) -> None:
    target.slave.al.fail(int(words[0], 0))


def _mailbox(target: Target, words: list[str]) -> None:
    target.slave.mailbox.silent = _switch(words, "silent", "healthy")


def _timeout(target: Target, words: list[str]) -> None:
    target.slave.faults.unanswered.add((int(words[0], 0), None))


def _abort(target: Target, words: list[str]) -> None:
    target.slave.faults.aborts[int(words[0], 0), None] = int(words[1], 0)


def _unpadded(target: Target, words: list[str]) -> None:
    target.slave.faults.unpadded = True


def _emcy(target: Target, words: list[str]) -> None:
    target.slave.emergency(int(words[0], 0))


def _drift(target: Target, words: list[str]) -> None:
    target.slave.controller.clock.set_drift(float(words[0]) * 1e-6, time.monotonic_ns())


def _sync0(target: Target, words: list[str]) -> None:
    target.slave.controller.clock.sync0 = _switch(words, "on", "off")


def _state(target: Target, words: list[str]) -> str:
    al = target.slave.al
    return f"{al.state.name} 0x{al.code:04X}"


def _heal(target: Target, words: list[str]) -> None:
    line, slave = target.line, target.slave
    slave.faults.heal()
    slave.mailbox.silent = False
    slave.change_identity(slave.identity)
    slave.controller.clock.set_drift(0.0, time.monotonic_ns())
    slave.controller.clock.sync0 = True
    cable = line.cables[target.number]
    cable.cut, cable.loss, cable.corruption = False, 0.0, 0.0
    line.update()
    line.power(target.number, True, time.monotonic_ns())


_FAULTS: dict[str, Fault] = {
    "off": _off,
    "on": _on,
    "cut": _cut,
    "join": _join,
    "loss": _loss,
    "corrupt": _corrupt,
    "identity": _identity,
    "al": _al,
    "mailbox": _mailbox,
    "timeout": _timeout,
    "abort": _abort,
    "unpadded": _unpadded,
    "emcy": _emcy,
    "drift": _drift,
    "sync0": _sync0,
    "state": _state,
    "heal": _heal,
}
