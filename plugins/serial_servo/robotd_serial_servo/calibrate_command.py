"""``robotd calibrate``: middle and ranges of an arm by hand, as LeRobot does."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from robotd.api import InvalidArgument
from robotd.api.commands import ExitCode

if TYPE_CHECKING:
    from robotd.api import RobotDescriptor
    from robotd_serial_servo.calibration import JointCalibration
    from robotd_serial_servo.options import SerialServoOptions
    from robotd_serial_servo.servo_bus import ServoBus

SHOW_S = 0.1
READ_TRIES = 5
MIDDLE_TICKS = 300  # that a loose joint may sink meanwhile; a wrong offset is seen all the same
STORED_S = 3.0  # some servos show 0 for a moment after their offset was stored
UP = "\x1b[{}A"  # VT100: lines up; and clear the rest of the line
CLEAR = "\x1b[K"
LAST_TICK = 4095
FULL_TURN = 3900  # a joint that was turned so far has no ends: LeRobot gives it all of its turn
MIN_RANGE = 100


@click.command("calibrate")
@click.option("--robot", required=True, metavar="NAME|FILE", help="The robot.")
@click.option("--backend", metavar="NAME", help="Its bus; by default that of the robot's file.")
@click.option("--port", metavar="DEVICE", help="Port; by default that of the robot's file.")
@click.option(
    "--file",
    "path",
    metavar="FILE",
    type=click.Path(path_type=Path, dir_okay=False),
    required=True,
    help="Calibration to write, or with --store to read; LeRobot reads it, too.",
)
@click.option("--store", is_flag=True, help="Write FILE into the servos; nothing is measured.")
@click.option("--yes", is_flag=True, help="Do not ask before the servos go off.")
def calibrate(
    robot: str, backend: str | None, port: str | None, path: Path, *, store: bool, yes: bool
) -> ExitCode:
    """Measure an arm by hand: its middle, then the range of each joint.

    The servos are switched off, and stay off: support the arm. Offsets and ranges are stored in the
    servos, and in FILE.
    """
    from robotd.api import load_robot_descriptor, validate_section
    from robotd_serial_servo.bus_scan import opened
    from robotd_serial_servo.calibration import read_calibration, write_calibration
    from robotd_serial_servo.families import family, family_of

    descriptor = load_robot_descriptor(robot)
    chosen = family(backend) if backend else family_of(descriptor)
    options = validate_section(descriptor, chosen.options.section, chosen.options)
    joints = joint_servos(descriptor, options)
    device = port or options.port
    if not device:
        raise InvalidArgument("name the port: --port /dev/ttyACM0")
    if not store and path.exists():
        raise InvalidArgument(f"{path} exists already; --store writes it into the servos")
    stored = read_calibration(path) if store else {}
    timeout_s = options.reply_timeout_s
    with opened(chosen.open_bus, device, options.baudrate, timeout_s) as bus:
        if not yes:
            click.confirm("The servos go off, the arm falls: support it. Go on", abort=True)
        release_all(bus, joints)
        if store:
            store_all(bus, joints, stored)
            click.echo(f"{path} is in the servos of {', '.join(joints)}")
            return ExitCode.OK
        click.echo("Move every joint to the middle of its range, then press Enter.")
        if not sys.stdin.readline():
            raise click.Abort
        offsets = store_middle(bus, joints)
        click.echo("Move each joint from one end to the other, then press Enter.")
        ranges = _sweep(bus, joints)
        found = calibrations(joints, offsets, ranges)
        store_all(bus, joints, found)
        write_calibration(path, found)
    section = chosen.options.section
    click.echo(
        f"{path} is written, and in the servos: --set {section}.calibration={path.absolute()}"
    )
    return ExitCode.OK


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


def store_middle(bus: ServoBus, joints: Mapping[str, int]) -> dict[str, int]:
    """Make the present positions the middle; return the offsets.

    Raises BusError: a servo does not show the middle afterwards.
    """
    from robotd_serial_servo.calibration import half_turn_offset

    offsets = {}
    for joint, servo in joints.items():
        identity = bus.identify(servo)
        position = positions(bus, [servo])[servo]
        offsets[joint] = half_turn_offset(position, identity.offset, bus.offset_sign)
        bus.store(servo, offsets[joint], (0, LAST_TICK))
    for servo in joints.values():
        _wait_for_middle(bus, servo)
    return offsets


def _wait_for_middle(bus: ServoBus, servo: int) -> None:
    from robotd_serial_servo.calibration import MIDDLE
    from robotd_serial_servo.servo_bus import BusError

    end = time.monotonic() + STORED_S
    while abs((position := positions(bus, [servo])[servo]) - MIDDLE) > MIDDLE_TICKS:
        if time.monotonic() > end:
            what = f"servo {servo} shows {position} after its offset was stored, not {MIDDLE}"
            raise BusError(f"{what}: keep the arm still, and calibrate again")
        time.sleep(SHOW_S)


def positions(bus: ServoBus, servos: Sequence[int]) -> dict[int, int]:
    """Return the positions of all ``servos``, ticks. Raises NoReply."""
    from robotd_serial_servo.servo_bus import NoReply

    found = dict[int, int]()
    for _ in range(READ_TRIES):
        missing = [servo for servo in servos if servo not in found]
        found |= {servo: state.position for servo, state in bus.read(missing).items()}
        if len(found) == len(servos):
            return found
    silent = ", ".join(str(servo) for servo in servos if servo not in found)
    raise NoReply(f"servo {silent} does not answer: cable or supply")


def calibrations(
    joints: Mapping[str, int], offsets: Mapping[str, int], ranges: Mapping[str, tuple[int, int]]
) -> dict[str, JointCalibration]:
    """Return the content of a file. Raises InvalidArgument: a joint was not moved."""
    from robotd_serial_servo.calibration import JointCalibration

    still = [joint for joint in joints if ranges[joint][1] - ranges[joint][0] < MIN_RANGE]
    if still:
        raise InvalidArgument(f"{', '.join(still)}: not moved, no file is written; calibrate again")
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
        time.sleep(SHOW_S)


def _sweep(bus: ServoBus, joints: Mapping[str, int]) -> dict[str, tuple[int, int]]:
    """Follow the joints until Enter; return lowest and highest position of each."""
    ended = threading.Event()

    def wait_for_enter() -> None:
        sys.stdin.readline()
        ended.set()

    threading.Thread(target=wait_for_enter, daemon=True).start()
    found = positions(bus, list(joints.values()))
    ranges = {joint: (found[servo], found[servo]) for joint, servo in joints.items()}
    terminal = sys.stdout.isatty()
    if terminal:
        click.echo("\n".join(_table(joints, ranges, found)))
    while not ended.is_set():
        found = {servo: state.position for servo, state in bus.read(list(joints.values())).items()}
        for joint, servo in joints.items():
            if servo in found:
                low, high = ranges[joint]
                ranges[joint] = min(low, found[servo]), max(high, found[servo])
        if terminal:
            lines = _table(joints, ranges, found)
            click.echo(UP.format(len(lines)) + "\n".join(line + CLEAR for line in lines))
        time.sleep(SHOW_S)
    return ranges


def _table(
    joints: Mapping[str, int], ranges: Mapping[str, tuple[int, int]], found: Mapping[int, int]
) -> list[str]:
    lines = [f"{'joint':16}{'lowest':>8}{'now':>8}{'highest':>9}"]
    for joint, servo in joints.items():
        (low, high), now = ranges[joint], found.get(servo, "-")
        lines.append(f"{joint:16}{low:8}{now:>8}{high:9}")
    return lines
