"""``robotd calibrate``: middle and ranges of an arm by hand, on the terminal or on a page."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from robotd.api import InvalidArgument
from robotd.api.commands import PORT, ExitCode, Interrupt

if TYPE_CHECKING:
    from robotd_serial_servo.hand_calibration import Ranges
    from robotd_serial_servo.servo_bus import ServoBus

SHOW_S = 0.1
UP = "\x1b[{}A"  # VT100: lines up; and clear the rest of the line
CLEAR = "\x1b[K"


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
@click.option(
    "--page",
    "page_port",
    metavar="[PORT]",
    is_flag=False,
    flag_value=0,
    type=PORT,
    help="Calibrate on a page of the browser, at the address that is printed; by default at any"
    " free port.",
)
@click.option("--yes", is_flag=True, help="Do not ask before the servos go off.")
def calibrate(
    robot: str,
    backend: str | None,
    port: str | None,
    path: Path,
    *,
    store: bool,
    page_port: int | None,
    yes: bool,
) -> ExitCode:
    """Measure an arm by hand: its middle, then the range of each joint.

    The servos are switched off, and stay off: support the arm. Offsets and ranges are stored in the
    servos, and in FILE. Nothing else can use the arm meanwhile.
    """
    from robotd.api import load_robot_descriptor, validate_section
    from robotd_serial_servo.bus_scan import opened
    from robotd_serial_servo.calibration import read_calibration
    from robotd_serial_servo.families import family, family_of
    from robotd_serial_servo.hand_calibration import joint_servos, release_all, store_all

    if store and page_port is not None:
        raise click.UsageError("--store measures nothing: leave --page out")
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
    section = chosen.options.section
    setting = f"--set {section}.calibration={path.absolute()}"
    written = f"{path} is written, and in the servos: start the robot anew with {setting}"
    with opened(chosen.open_bus, device, options.baudrate, timeout_s) as bus:
        if page_port is not None:
            names = {"robot": descriptor.name, "port": device, "file": str(path)}
            _calibrate_on_page(bus, joints, path, page_port, names, written, ask=not yes)
            return ExitCode.OK
        if not yes:
            click.confirm("The servos go off, the arm falls: support it. Go on", abort=True)
        release_all(bus, joints)
        if store:
            store_all(bus, joints, stored)
            click.echo(f"{path} is in the servos of {', '.join(joints)}")
            return ExitCode.OK
        _calibrate_on_terminal(bus, joints, path)
    click.echo(written)
    return ExitCode.OK


def _calibrate_on_page(
    bus: ServoBus,
    joints: Mapping[str, int],
    path: Path,
    port: int,
    names: Mapping[str, str],
    written: str,
    *,
    ask: bool,
) -> None:
    from robotd_serial_servo.calibration_page import CalibrationPage, calibrate_on_page
    from robotd_serial_servo.loopback_server import serve_page

    with Interrupt() as interrupt:
        page = CalibrationPage(names, interrupt)
        with serve_page(page.answer, port) as bound:
            click.echo(f"page {page.address(bound)} controls the arm: keep it to yourself")
            calibrate_on_page(bus, joints, path, page, written=written, ask=ask)
            click.echo(written)


def _calibrate_on_terminal(bus: ServoBus, joints: Mapping[str, int], path: Path) -> None:
    from robotd_serial_servo.hand_calibration import Ranges, new_offsets, save, store_middle

    offsets = dict[str, int]()
    click.echo("Move every joint to the middle of its range, then press Enter.")
    if not sys.stdin.readline():
        raise click.Abort
    try:
        store_middle(bus, joints, offsets)
        click.echo("Move each joint from one end to the other, then press Enter.")
        ranges = Ranges(bus, joints)
        _follow_until_enter(ranges)
        save(bus, joints, offsets, ranges, path)
    except BaseException:  # also Ctrl-C
        if offsets:
            click.echo(f"\n{new_offsets([*offsets])}", err=True)
        raise


def _follow_until_enter(ranges: Ranges) -> None:
    ended = threading.Event()

    def wait_for_enter() -> None:
        sys.stdin.readline()
        ended.set()

    threading.Thread(target=wait_for_enter, daemon=True).start()
    terminal = sys.stdout.isatty()
    if terminal:
        click.echo("\n".join(_table(ranges)))
    while not ended.is_set():
        ranges.follow()
        if terminal:
            lines = _table(ranges)
            click.echo(UP.format(len(lines)) + "\n".join(line + CLEAR for line in lines))
        time.sleep(SHOW_S)


def _table(ranges: Ranges) -> list[str]:
    lines = [f"{'joint':16}{'lowest':>8}{'now':>8}{'highest':>9}"]
    for joint, (low, high) in ranges.found.items():
        lines.append(f"{joint:16}{low:8}{ranges.now.get(joint, '-'):>8}{high:9}")
    return lines
