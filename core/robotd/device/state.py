"""Enums of the states of a device and its axes."""

from __future__ import annotations

from enum import Enum, IntEnum


class ConnectionState(Enum):
    """States of the connection to the device; the values are for people."""

    IDLE = "Idle"  # no device open
    RUNNING = "Running"  # device open, fieldbus not exchanging data
    COMMUNICATING = "Communicating"  # cyclic data flows, axes can be commanded
    SHUTDOWN = "Shutdown"  # closed for good
    UNKNOWN = "Unknown"  # the device does not say


COMMUNICATES = (ConnectionState.COMMUNICATING, ConnectionState.UNKNOWN)  # as far as is known


class CommandMode(IntEnum):
    """Quantity of an axis' setpoint; clients know the numbers."""

    POSITION = 0
    VELOCITY = 1
    TORQUE = 2


class Operation(IntEnum):
    """Current operation of an axis."""

    IDLE = 0
    POSITION = 1  # executing a move
    VELOCITY = 2  # executing a velocity command
    STREAM = 3  # following setpoints or a trajectory
    HOMING = 4
    STOPPING = 5
    GUIDING = 6  # moved by hand


STREAMING, GUIDING = int(Operation.STREAM), int(Operation.GUIDING)
"""For arrays: NumPy compares with an int in 1 µs, with a member of an enum in 8 (Python 3.11)."""


class Underrun(Enum):
    """Behaviour of a streaming axis while its next setpoint is late."""

    EXTRAPOLATE = "extrapolate"
    """It continues with the velocity of the last setpoint for ``EXTRAPOLATION_PERIODS``, and then
    holds. An axis in velocity mode keeps its velocity, until the device stops it."""

    HOLD = "hold"  # it stops at the last setpoint, and executes a late one when it comes


EXTRAPOLATION_PERIODS = 1.5
"""One missing setpoint, and the half period by which the next one may be late."""
