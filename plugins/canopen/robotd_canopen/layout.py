"""Layout of the network, from the descriptor section and the EDS files.

``plan_network`` finds every error that can be found without a bus.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from canopen.objectdictionary import ObjectDictionary

from robotd.api import DescriptorError, RobotDescriptor
from robotd_canopen.default_pdos import default_pdos
from robotd_canopen.frame import bus_load, frame_bits
from robotd_canopen.object_dictionary import (
    GENERIC_DRIVE,
    GENERIC_IO,
    dcf_values,
    describe,
    eds_path,
    empty_dictionary,
    read_eds,
    startup_writes,
    variable,
)
from robotd_canopen.options import AxisOptions, CanopenOptions, IoOptions, NodeOptions, PdoOptions
from robotd_canopen.pdo import MAX_SYNCHRONOUS, Direction, Pdo, io_pdos, resolve
from robotd_cia402.guiding import (
    GUIDING_INPUTS,
    GUIDING_KEY,
    GUIDING_OUTPUTS,
    MAX_UNWATCHED_S,
    guiding_problems,
    is_guided,
)
from robotd_cia402.modes import OperationMode
from robotd_cia402.object_numbers import MODE, MODE_DISPLAY, narrow_positions, on_axis
from robotd_cia402.options import OptionProblems, SetpointMode, parse_object, with_robot_ramps

_SECTION = "backends.canopen"
_NEEDED = (0x6040, 0x6041, 0x6060, 0x6061, 0x6064)  # without these it is no CiA 402 drive
_SUPPORTED_MODES = 0x6502
_HEARTBEAT = 0x1017
NO_HEARTBEAT = (
    "object 0x1017 (heartbeat) is not in the EDS: set heartbeat: false to supervise the drive by"
    " its PDOs"
)
_BY_PDO = {0x6040: "controlword", 0x607A: "target position"}
_INTERPOLATED = {0x60C1: "interpolation data"}
_FROM_PDO = {0x6041: "statusword", 0x6064: "position"}


Options = TypeVar("Options", bound=NodeOptions)


@dataclass(frozen=True)
class NodeLayout(Generic[Options]):
    """One axis or I/O module: its options, dictionary and PDOs."""

    options: Options
    dictionary: ObjectDictionary
    rpdos: tuple[Pdo, ...]
    tpdos: tuple[Pdo, ...]


IoLayout = NodeLayout[IoOptions]


@dataclass(frozen=True)
class AxisLayout(NodeLayout[AxisOptions]):
    """One axis.

    Attributes:
        left_out: optional objects that default PDOs do not hold, because of the EDS.
    """

    left_out: tuple[int, ...] = ()

    def index(self, base: int) -> int:
        """The profile object ``base`` on this axis of the drive."""
        return on_axis(base, self.options.axis_offset)


@dataclass(frozen=True)
class NetworkLayout:
    """The whole network. ``cycles_per_sync``: SYNC is sent in each n-th control period."""

    options: CanopenOptions
    axes: tuple[AxisLayout, ...]
    io: tuple[IoLayout, ...]
    sync_period_s: float
    cycles_per_sync: int
    bus_load: float

    @property
    def node_ids(self) -> set[int]:
        """Node ids of drives and modules."""
        drives, modules = (axis.options for axis in self.axes), (one.options for one in self.io)
        return {drive.node for drive in drives} | {module.node for module in modules}

    @property
    def frames_per_sync(self) -> int:
        """Frames that robotd sends for one SYNC: itself, the RPDOs, and one for the heartbeat."""
        modules = sum(len(module.rpdos) for module in self.io)
        return 2 + modules + sum(len(_most_rpdos(axis)) for axis in self.axes)

    def pdos(self, node: int | None = None) -> list[Pdo]:
        """The PDOs of one node, or of all."""
        nodes: list[NodeLayout[Any]] = [*self.axes, *self.io]
        return [
            pdo
            for one in nodes
            if node in (None, one.options.node)
            for pdo in (*one.rpdos, *one.tpdos)
        ]


def plan_network(robot: RobotDescriptor, options: CanopenOptions) -> NetworkLayout:
    """Raises DescriptorError with every problem."""
    options = options.model_copy(update={"axes": with_robot_ramps(options.axes, robot)})
    problems = OptionProblems(robot, _SECTION)
    if options.bus.channel is None and options.bus.interface != "virtual":
        what = f"missing: name the CAN bus, for example --set {_SECTION}.bus.channel=can0"
        problems.add("bus.channel", what)
    problems.check_axes(options.axes)
    planner = _NodePlanner(robot, problems)
    axes = [planner.axis(f"axes.{number}", drive) for number, drive in enumerate(options.axes)]
    if any(is_guided(axis.options) for axis in axes):
        _check_guiding(robot, options, axes, problems)
    axes.sort(key=lambda axis: axis.options.axis)
    modules = [planner.module(f"io.{number}", module) for number, module in enumerate(options.io)]
    users: dict[int, str] = {}
    nodes: list[NodeLayout[Any]] = [*axes, *modules]
    for node in nodes:
        for pdo in (*node.rpdos, *node.tpdos):
            name = f"{pdo.name} of node {node.options.node}"
            if pdo.cob_id in users:
                what = f"{users[pdo.cob_id]} and {name} have one COB-ID, 0x{pdo.cob_id:03X}"
                problems.add("axes", what)
            users[pdo.cob_id] = name
    cycle_s = 1 / robot.cycle.rate_hz
    period_s = options.sync_period_s or cycle_s
    ratio = round(period_s / cycle_s)
    if ratio < 1 or abs(ratio * cycle_s - period_s) > 1e-3 * cycle_s:
        what = f"{period_s:g} s is not a whole number of cycles of {cycle_s:g} s"
        problems.add("sync_period_s", what)
    load = _load(axes, modules, options, period_s)
    if load > options.max_bus_load:
        problems.add(
            "sync_period_s",
            f"a SYNC each {period_s:g} s loads the bus of {options.bus.bitrate} bit/s with"
            f" {load:.0%}, max_bus_load is {options.max_bus_load:.0%}",
        )
    problems.require_none()
    return NetworkLayout(options, tuple(axes), tuple(modules), period_s, max(1, ratio), load)


class _NodePlanner:
    """Plans axes and modules by their EDS files, and adds to ``problems``."""

    def __init__(self, robot: RobotDescriptor, problems: OptionProblems) -> None:
        self._folder = robot.path.parent if robot.path is not None else None
        self._problems = problems

    def axis(self, key: str, drive: AxisOptions) -> AxisLayout:
        add = self._problems.add
        dictionary = self._dictionary(key, drive, GENERIC_DRIVE)
        if not dictionary:  # unreadable: what it lacks is no problem of its own
            return AxisLayout(drive, dictionary, (), ())
        defaults = {
            direction: default_pdos(drive, direction, dictionary)
            for direction, given in zip(Direction, (drive.rpdos, drive.tpdos), strict=True)
            if not given
        }
        left_out = [base for chosen in defaults.values() for base in chosen.left_out]
        receive, transmit = (
            list(given or defaults[direction].pdos)
            for direction, given in zip(Direction, (drive.rpdos, drive.tpdos), strict=True)
        )
        for base in (*_NEEDED, *([_SUPPORTED_MODES] if drive.check_modes else [])):
            index = on_axis(base, drive.axis_offset)
            if variable(dictionary, index, 0) is None:
                add(key, f"object 0x{index:04X} is not in the EDS")
        if drive.heartbeat and variable(dictionary, _HEARTBEAT, 0) is None:
            add(key, NO_HEARTBEAT)
        rpdos = self._resolve(key, receive, Direction.RECEIVE, drive, dictionary)
        tpdos = self._resolve(key, transmit, Direction.TRANSMIT, drive, dictionary)
        outputs = _BY_PDO | (_INTERPOLATED if drive.stream_mode is SetpointMode.IP else {})
        for pdos, needed in ((receive, outputs), (transmit, _FROM_PDO)):
            mapped = {parse_object(name)[0] for pdo in pdos for name in pdo.objects}
            for base, name in needed.items():
                if base not in mapped:
                    add(key, f"no PDO holds 0x{base:04X} ({name})")
        planned = (*rpdos, *tpdos)
        entries = [(e.base, e.index, e.bits) for pdo in planned for e in pdo.entries]
        lost = _unreachable_mode(planned, dictionary, drive.axis_offset)
        for what in (*lost, *narrow_positions(entries)):
            add(key, what)
        for what in _unknowable(tpdos, dictionary):
            add(f"{key}.tpdos", what)
        return AxisLayout(drive, dictionary, rpdos, tpdos, tuple(left_out))

    def module(self, key: str, module: IoOptions) -> IoLayout:
        dictionary = self._dictionary(key, module, GENERIC_IO)
        receive, transmit = io_pdos(module) if dictionary else ([], [])
        rpdos = self._resolve(key, receive, Direction.RECEIVE, module, dictionary)
        tpdos = self._resolve(key, transmit, Direction.TRANSMIT, module, dictionary)
        return IoLayout(module, dictionary, rpdos, tpdos)

    def _dictionary(self, key: str, node: NodeOptions, generic: str) -> ObjectDictionary:
        add = self._problems.add
        try:
            dictionary = read_eds(eds_path(node.eds, self._folder, generic), node.node)
        except DescriptorError as error:
            known = [str(problem) for problem in self._problems.found]
            if not any(str(error) in problem for problem in known):  # six drives, one file
                add(f"{key}.eds", str(error))
            return empty_dictionary()
        for what in _no_dcf(dictionary, node) if node.dcf_values else ():
            add(f"{key}.dcf_values", what)
        for number, (index, sub, _) in enumerate(startup_writes(node)):
            found = variable(dictionary, index, sub)
            if found is None or not found.writable:
                what = f"{describe(dictionary, index, sub)} is not in the EDS, or cannot be written"
                add(f"{key}.startup.{number}", what)
        return dictionary

    def _resolve(
        self,
        key: str,
        pdos: list[PdoOptions],
        direction: Direction,
        node: NodeOptions,
        dictionary: ObjectDictionary,
    ) -> tuple[Pdo, ...]:
        offset = node.axis_offset if isinstance(node, AxisOptions) else 0
        resolved = []
        kind = "rpdos" if direction is Direction.RECEIVE else "tpdos"
        is_default = isinstance(node, AxisOptions) and not getattr(node, kind)
        for position, pdo in enumerate(pdos):
            try:
                resolved.append(resolve(pdo, direction, node.node, dictionary, offset))
            except ValueError as error:
                default = f"default {kind[:4].upper()} {pdo.number}: " if is_default else ""
                where = key if is_default else f"{key}.{kind}.{position}"
                self._problems.add(where, f"{default}{error}")
        return tuple(resolved)


def _check_guiding(
    robot: RobotDescriptor,
    options: CanopenOptions,
    axes: Sequence[AxisLayout],
    problems: OptionProblems,
) -> None:
    """Add what axes lack that are to be guided by hand."""
    drives = [axis.options for axis in axes]
    for number, what in guiding_problems(robot, drives):
        problems.add(f"axes.{number}.{GUIDING_KEY}", what)
    for number, axis in enumerate(axes):
        if not is_guided(axis.options) or not axis.dictionary:
            continue
        for pdos, needed in ((axis.rpdos, GUIDING_OUTPUTS), (axis.tpdos, GUIDING_INPUTS)):
            # Its age is counted in SYNCs, and a torque acts until the next one.
            each = [pdo for pdo in pdos if pdo.transmission == 1]
            for base, name in needed.items():
                if not any(pdo.holds(base) for pdo in each):
                    what = f"hand guiding takes 0x{base:04X} ({name}) in a PDO of each SYNC"
                    problems.add(f"axes.{number}.{GUIDING_KEY}", what)
    if options.heartbeat_timeout_s > MAX_UNWATCHED_S:
        what = f"{options.heartbeat_timeout_s:g} s is above {MAX_UNWATCHED_S:g} s: a drive that is"
        problems.add("heartbeat_timeout_s", f"{what} guided by hand keeps its torque for so long")


def _unreachable_mode(
    pdos: Sequence[Pdo], dictionary: ObjectDictionary, axis_offset: int
) -> Iterator[str]:
    """Yield why a mode that is not in the PDOs cannot be changed, or read back, by SDO."""
    mapped = {entry.base for pdo in pdos for entry in pdo.entries}
    mode, display = (
        variable(dictionary, on_axis(base, axis_offset), 0) for base in (MODE, MODE_DISPLAY)
    )
    if mode is not None and MODE not in mapped and not mode.writable:
        yield "no PDO holds 0x6060 (modes of operation), and it cannot be written by SDO"
    if display is not None and not {MODE, MODE_DISPLAY} <= mapped and not display.readable:
        yield "the mode is changed by SDO, and 0x6061 (mode display) cannot be read by SDO"


def _unknowable(tpdos: Sequence[Pdo], dictionary: ObjectDictionary) -> Iterator[str]:
    """Yield reasons why values of an axis, or their age, stay unknown."""
    if tpdos and all(pdo.is_event_driven for pdo in tpdos):
        yield (
            "all TPDOs are event-driven, so that nothing shows the age of their values;"
            f" give one of them a transmission of 1 to {MAX_SYNCHRONOUS}"
        )
    for pdo in tpdos:
        for entry in pdo.inputs if pdo.is_event_driven else ():
            found = variable(dictionary, entry.index, entry.sub)
            if found is not None and not found.readable:
                name = describe(dictionary, entry.index, entry.sub)
                yield (
                    f"{pdo.name} is event-driven, and {name} cannot be read by SDO: its value is"
                    " unknown until the node sends it;"
                    f" give the PDO a transmission of 1 to {MAX_SYNCHRONOUS}"
                )


def _no_dcf(dictionary: ObjectDictionary, node: NodeOptions) -> Iterator[str]:
    """Yield reasons why the values of a file cannot be written to ``node``."""
    values = dcf_values(dictionary)
    file = node.eds or "the generic EDS"
    if all(value.skipped for value in values):
        yield f"no object of {file} has a ParameterValue that can be written: is it a DCF?"
    if values and dictionary.node_id not in (None, 0, node.node):
        yield f"{file} is the DCF of node {dictionary.node_id}, this is node {node.node}"
    for value in values:
        if value.skipped.startswith("does not fit"):
            yield f"{value.name}: ParameterValue {value.text} {value.skipped}"


def _load(
    axes: list[AxisLayout], modules: list[IoLayout], options: CanopenOptions, period_s: float
) -> float:
    """Load with every axis in the operation mode whose RPDOs load the bus most."""
    cyclic = [
        (pdo.layout.size, 1 / pdo.transmission)
        for axis in axes
        for pdo in (*_most_rpdos(axis), *axis.tpdos)
        if not pdo.is_event_driven
    ]
    nodes = {axis.options.node for axis in axes} | {module.options.node for module in modules}
    return bus_load(cyclic, period_s, len(nodes) + 1, options.heartbeat_s, options.bus.bitrate)


def _most_rpdos(axis: AxisLayout) -> list[Pdo]:
    """Return the RPDOs of the operation mode in which they load the bus most."""
    sent = (
        [pdo for pdo in axis.rpdos if pdo.modes is None or mode in pdo.modes]
        for mode in OperationMode
    )
    return max(sent, key=lambda pdos: sum(frame_bits(pdo.layout.size) for pdo in pdos))
