"""Plan of the bus from the descriptor section, with every error found without a bus."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from robotd.api import RobotDescriptor
from robotd_cia402.guiding import GUIDING_KEY, MAX_UNWATCHED_S, guiding_problems, is_guided
from robotd_cia402.object_numbers import (
    CONTROLWORD,
    MODE,
    MODE_DISPLAY,
    POSITION,
    STATUSWORD,
    TARGET_POSITION,
    TARGET_TORQUE,
    TARGET_VELOCITY,
    TORQUE,
    on_axis,
)
from robotd_cia402.options import (
    OptionProblems,
    SetpointMode,
    VelocityMode,
    parse_object,
    with_robot_ramps,
)
from robotd_ethercat.options import AxisOptions, EthercatOptions, PdoOptions, SlaveOptions

_SECTION = "backends.ethercat"
_NAMES = {
    CONTROLWORD: "controlword",
    MODE: "modes of operation",
    TARGET_POSITION: "target position",
    TARGET_VELOCITY: "target velocity",
    STATUSWORD: "statusword",
    MODE_DISPLAY: "modes of operation display",
    POSITION: "position actual value",
    TARGET_TORQUE: "target torque",
    TORQUE: "torque actual value",
}
NEEDED_INPUTS = (STATUSWORD, MODE_DISPLAY, POSITION)


@dataclass(frozen=True)
class BusPlan:
    """The bus as it is configured. ``axes`` in the order of the robot's axes."""

    options: EthercatOptions
    axes: tuple[AxisOptions, ...]
    period_s: float

    @property
    def bus_name(self) -> str:
        """Name of the bus for messages."""
        return "simulated slaves" if self.options.simulated else self.options.interface or ""

    @property
    def slaves(self) -> dict[int, list[SlaveOptions]]:
        """Options of each configured slave by its place; several for a multi-axis drive."""
        found: dict[int, list[SlaveOptions]] = {}
        for options in (*self.axes, *self.options.io):
            found.setdefault(options.slave, []).append(options)
        return dict(sorted(found.items()))


def plan_bus(robot: RobotDescriptor, options: EthercatOptions) -> BusPlan:
    """Raises DescriptorError with every problem."""
    problems = OptionProblems(robot, _SECTION)
    if options.interface is None and not options.simulated:
        problems.add(
            "interface",
            "missing: name the network interface of the bus, for example --set"
            f" {_SECTION}.interface=enp3s0; 'robotd ethercat doctor' lists those of this computer",
        )
    problems.check_axes(options.axes)
    for number, drive in enumerate(options.axes):
        key = f"axes.{number}"
        if drive.stream_mode is not SetpointMode.CSP:
            what = f"{drive.stream_mode.value!r} is a mode of CANopen drives, EtherCAT takes 'csp'"
            problems.add(f"{key}.stream_mode", what)
        pdos = (("rx_pdos", needed_outputs(drive)), ("tx_pdos", needed_inputs(drive)))
        for name, needed in pdos:
            given: tuple[PdoOptions, ...] = getattr(drive, name)
            if not given or any(not pdo.objects for pdo in given):
                continue  # contents of the drive's own are checked on the bus
            held = {parse_object(entry)[0] for pdo in given for entry in pdo.objects}
            missing = [base for base in needed if on_axis(base, drive.axis_offset) not in held]
            if missing:
                what = f"no PDO holds {missing_text(missing, drive.axis_offset)}"
                problems.add(f"{key}.{name}", what)
    for number, what in guiding_problems(robot, options.axes):
        problems.add(f"axes.{number}.{GUIDING_KEY}", what)
    if any(is_guided(drive) for drive in options.axes):
        longest_ms = 1000 * MAX_UNWATCHED_S
        if options.watchdog_ms is None or options.watchdog_ms > longest_ms:
            what = "a drive that is guided by hand keeps its torque for so long when robotd is lost"
            problems.add("watchdog_ms", f"give at most {longest_ms:g}: {what}")
    problems.require_none()
    axes = with_robot_ramps(options.axes, robot)
    ordered = tuple(sorted(axes, key=lambda drive: drive.axis))
    return BusPlan(options, ordered, 1 / robot.cycle.rate_hz)


def needed_outputs(drive: AxisOptions) -> tuple[int, ...]:
    """Objects that the cyclic frames to a drive must hold."""
    cyclic = drive.velocity_mode is VelocityMode.CSV
    velocity = (TARGET_VELOCITY,) if cyclic else ()
    torque = (TARGET_TORQUE,) if is_guided(drive) else ()
    return (CONTROLWORD, MODE, TARGET_POSITION, *velocity, *torque)


def needed_inputs(drive: AxisOptions) -> tuple[int, ...]:
    """Objects that the cyclic frames of a drive must hold."""
    return (*NEEDED_INPUTS, TORQUE) if is_guided(drive) else NEEDED_INPUTS


def missing_text(missing: Iterable[int], axis_offset: int) -> str:
    """``0x6060 (modes of operation), 0x607A (target position)``."""
    names = [f"0x{on_axis(base, axis_offset):04X} ({_NAMES[base]})" for base in missing]
    return ", ".join(names)
