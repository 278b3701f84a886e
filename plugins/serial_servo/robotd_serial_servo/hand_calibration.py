"""Calibration of an arm by hand, as LeRobot does it: the middle of its range, then its ends.

``release_all``, ``store_middle``, ``Ranges.follow`` as often as the joints are moved, ``save``: all
on an open bus, by one thread.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from robotd.api import InvalidArgument
from robotd_serial_servo.calibration import (
    MIDDLE,
    JointCalibration,
    half_turn_offset,
    write_calibration,
)
from robotd_serial_servo.servo_bus import BusError, NoReply

if TYPE_CHECKING:
    from robotd.api import RobotDescriptor
    from robotd_serial_servo.options import SerialServoOptions
    from robotd_serial_servo.servo_bus import ServoBus

READ_TRIES = 5
POLL_S = 0.1
SILENCE_LIMIT_S = 2.0  # without a reply while joints are moved by hand
MIDDLE_TICKS = 300  # that a loose joint may sink meanwhile; a wrong offset is seen all the same
STORED_S = 3.0  # some servos show 0 for a moment after their offset was stored
LAST_TICK = 4095
FULL_TURN = 3900  # a joint that was turned so far has no ends: LeRobot gives it all of its turn
MIN_RANGE = 100


class Ranges:
    """Lowest and highest position of each joint while it is moved by hand.

    Attributes:
        found: lowest and highest position by joint, ticks.
        now: present position by joint, ticks; without those that did not answer.
    """

    def __init__(self, bus: ServoBus, joints: Mapping[str, int]) -> None:
        """Begin at the present positions. Raises NoReply: a servo does not answer."""
        self._bus = bus
        self._joints = joints
        self._silent_since = dict[str, float]()
        present = positions(bus, list(joints.values()))
        self.now = {joint: present[servo] for joint, servo in joints.items()}
        self.found = {joint: (position, position) for joint, position in self.now.items()}

    def follow(self) -> None:
        """Read all positions once; a servo that does not answer keeps its range.

        Raises NoReply: one has not answered for ``SILENCE_LIMIT_S``. Raises BusError: one is on.
        """
        states = self._bus.read(list(self._joints.values()))
        self.now.clear()
        for joint, servo in self._joints.items():
            if servo not in states:
                self._check_silence(joint, servo)
                continue
            if states[servo].torque:
                what = f"servo {servo}, {joint}, is on without a command"
                raise BusError(f"{what}: end the program that writes to the bus, calibrate again")
            self._silent_since.pop(joint, None)
            position = self.now[joint] = states[servo].position
            low, high = self.found[joint]
            self.found[joint] = min(low, position), max(high, position)

    def not_moved(self) -> list[str]:
        """Return the joints that were not moved enough to have a range."""
        return [joint for joint, (low, high) in self.found.items() if high - low < MIN_RANGE]

    def _check_silence(self, joint: str, servo: int) -> None:
        now_s = time.monotonic()
        # From the first lost reply, not from the last one that came: a stall is no silence.
        if now_s - self._silent_since.setdefault(joint, now_s) > SILENCE_LIMIT_S:
            what = f"servo {servo}, {joint}, has not answered for {SILENCE_LIMIT_S:g} s"
            raise NoReply(f"{what}: cable or supply")


def joint_servos(robot: RobotDescriptor, options: SerialServoOptions) -> dict[str, int]:
    """Return the servo of each joint. Raises InvalidArgument: one has none."""
    servos = {keys.axis: keys.servo for keys in options.axes}
    missing = [joint.name for joint in robot.joints if joint.axis not in servos]
    if missing or not servos:
        raise InvalidArgument(f"{options.section}.axes: no servo for {', '.join(missing) or '?'}")
    return {joint.name: servos[joint.axis] for joint in robot.joints}


def release_all(bus: ServoBus, joints: Mapping[str, int]) -> None:
    """Switch all servos off, which detects an echo of the adapter, too."""
    for servo in joints.values():
        bus.ping(servo)
        bus.set_torque(servo, on=False)


def store_middle(bus: ServoBus, joints: Mapping[str, int], offsets: dict[str, int]) -> None:
    """Make the present positions the middle.

    Args:
        offsets: filled with the offset of each joint, before it is stored.

    Raises BusError: a servo does not show the middle afterwards.
    """
    for joint, servo in joints.items():
        identity = bus.identify(servo)
        position = positions(bus, [servo])[servo]
        offsets[joint] = half_turn_offset(position, identity.offset, bus.offset_sign)
        bus.store(servo, offsets[joint], (0, LAST_TICK))
    for servo in joints.values():
        _wait_for_middle(bus, servo)


def new_offsets(joints: Sequence[str]) -> str:
    """Return what to do where a calibration has ended after ``store_middle`` of ``joints``."""
    return (
        f"The servos of {', '.join(joints)} have new offsets: calibrate again, or store the old"
        " file with 'robotd calibrate --store --file OLD.json'."
    )


def _wait_for_middle(bus: ServoBus, servo: int) -> None:
    end = time.monotonic() + STORED_S
    while abs((position := positions(bus, [servo])[servo]) - MIDDLE) > MIDDLE_TICKS:
        if time.monotonic() > end:
            what = f"servo {servo} shows {position} after its offset was stored, not {MIDDLE}"
            raise BusError(f"{what}: keep the arm still, and calibrate again")
        time.sleep(POLL_S)


def positions(bus: ServoBus, servos: Sequence[int]) -> dict[int, int]:
    """Return the positions of all ``servos``, ticks. Raises NoReply."""
    found = dict[int, int]()
    for _ in range(READ_TRIES):
        missing = [servo for servo in servos if servo not in found]
        found |= {servo: state.position for servo, state in bus.read(missing).items()}
        if len(found) == len(servos):
            return found
    silent = ", ".join(str(servo) for servo in servos if servo not in found)
    raise NoReply(f"servo {silent} does not answer: cable or supply")


def save(
    bus: ServoBus,
    joints: Mapping[str, int],
    offsets: Mapping[str, int],
    ranges: Ranges,
    path: Path,
) -> None:
    """Store the calibration in the servos, then write it to ``path``.

    Raises InvalidArgument: a joint was not moved. Raises OSError: the file cannot be written.
    """
    if still := ranges.not_moved():
        raise InvalidArgument(f"{', '.join(still)}: not moved, no file is written; calibrate again")
    found = calibrations(joints, offsets, ranges.found)
    store_all(bus, joints, found)
    write_calibration(path, found)


def calibrations(
    joints: Mapping[str, int], offsets: Mapping[str, int], ranges: Mapping[str, tuple[int, int]]
) -> dict[str, JointCalibration]:
    """Return the content of a file."""
    found = {}
    for joint, servo in joints.items():
        low, high = ranges[joint]
        if high - low > FULL_TURN:
            low, high = 0, LAST_TICK
        found[joint] = JointCalibration(
            id=servo, homing_offset=offsets[joint], range_min=low, range_max=high
        )
    return found


def store_all(
    bus: ServoBus, joints: Mapping[str, int], found: Mapping[str, JointCalibration]
) -> None:
    """Write offsets and ranges into the servos. Raises InvalidArgument: a joint is missing."""
    missing = [joint for joint in joints if joint not in found]
    if missing:
        raise InvalidArgument(f"the calibration has no {', '.join(missing)}")
    for joint, servo in joints.items():
        calibration = found[joint]
        if calibration.id != servo:
            raise InvalidArgument(f"{joint} is servo {calibration.id} in the file, not {servo}")
        ends = max(0, calibration.range_min), min(calibration.range_max, LAST_TICK)
        bus.store(servo, calibration.homing_offset, ends)
    _wait_until_shown(bus, list(joints.values()))


def _wait_until_shown(bus: ServoBus, servos: Sequence[int]) -> None:
    """Wait until servos that show 0 while they store show their positions.

    A robot that opens them before would take 0 for their position. Where one is at 0, it costs
    ``STORED_S``.
    """
    end = time.monotonic() + STORED_S
    while 0 in positions(bus, servos).values() and time.monotonic() < end:
        time.sleep(POLL_S)
