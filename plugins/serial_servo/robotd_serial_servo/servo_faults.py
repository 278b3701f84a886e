"""Faults that the exchange finds in addition to those that a servo reports, as alarm codes."""

from __future__ import annotations

from enum import IntEnum


class Fault(IntEnum):
    """Alarm codes above the fault bits of a servo, which are one byte."""

    RESTARTED = 0x101
    SWITCHED_OFF = 0x102
    SWITCHED_ON = 0x103
    JUMPED = 0x104
    OUT_OF_TURN = 0x105
    GOAL_LOST = 0x106
    EXPIRED = 0x107


TEXTS = {
    Fault.RESTARTED: "the servo has restarted: its registers are as at power-on",
    Fault.SWITCHED_OFF: "the servo has switched itself off",
    Fault.SWITCHED_ON: "the servo is on without a command",
    Fault.JUMPED: "the position has jumped",
    Fault.OUT_OF_TURN: "the position is not within one turn",
    Fault.GOAL_LOST: "the servo does not keep the goals that it is sent",
    Fault.EXPIRED: "the servo has stopped: its bus was silent",
}
REMEDIES = {
    Fault.RESTARTED: "Check plug and supply: it was without power for a moment. Support the arm,"
    " clear the alarm and switch on: it goes on from where it is",
    Fault.SWITCHED_OFF: "Look for another program on the port; clear the alarm and switch on",
    Fault.SWITCHED_ON: "It was switched off again. Look for another program on the port, or on a"
    " second controller of the bus",
    Fault.JUMPED: "Compare the arm with its picture on the page. If they differ, the horn has"
    " slipped or the servo counts across its seam: calibrate again",
    Fault.OUT_OF_TURN: "Turn the joint back by hand with the servo off, and calibrate again",
    Fault.GOAL_LOST: "Look for another program on the port, and for a loose cable",
    Fault.EXPIRED: "Look for a loose cable, and at 'robotd health' for a computer that stalls."
    " Support the arm, clear the alarm, which switches the servo off, and switch on",
}
