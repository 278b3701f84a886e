"""Bring-up of all slaves, from Init to Op, one AL state after the other."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from robotd.api import (
    NANOSECONDS,
    Clock,
    ConnectError,
    OperationError,
    RobotdError,
    get_logger,
    wait_until,
)
from robotd_cia402.axis import Axis
from robotd_cia402.drive_scan import MAX_AXES
from robotd_cia402.drive_setup import set_up
from robotd_cia402.object_numbers import AXIS_STEP, CONTROLWORD, narrow_positions, on_axis
from robotd_cia402.start_pace import StartPace, start_limit
from robotd_ethercat.al_status import AlState, al_code_text
from robotd_ethercat.clock_observer import slaves_with_clocks
from robotd_ethercat.ethercat_drive import EthercatDrive
from robotd_ethercat.exchange import Exchange, full_counter
from robotd_ethercat.mapping import Assignment, Pdo, read_mapping, write_mapping
from robotd_ethercat.options import AxisOptions, Clocks
from robotd_ethercat.plan import BusPlan, missing_text, needed_inputs, needed_outputs
from robotd_ethercat.slave import Slave
from robotd_ethercat.soem import MappingError, Soem

log = get_logger("ethercat")

_POLL_S = 0.002
_EXCHANGED_PERIODS = 10  # between two looks at the states


class BringUp:
    """The steps from a cable with power to operational slaves. One worker thread.

    Each raises ConnectError with every slave that fails, its step, and what was found.
    """

    def __init__(
        self,
        plan: BusPlan,
        bus: Soem,
        slaves: Sequence[Slave],
        axes: Sequence[Axis[EthercatDrive]],
        exchange: Exchange,
        clock: Clock,
    ) -> None:
        self._plan, self._bus, self._slaves, self._axes = plan, bus, slaves, axes
        self._exchange, self._clock = exchange, clock
        self.clocks: list[int] = []
        self._pace = StartPace(clock)
        for slave in slaves:  # configured one after the other
            slave.pace = self._pace

    def identify(self) -> None:
        """Enumerate the slaves and compare them with the configured ones; all are in Init."""
        bus = self._bus
        for slave in self._slaves:
            if not all(options.complete_access for options in slave.options):
                bus.plain_sdo.add(slave.number)
        found = bus.find_slaves()
        if not found:
            raise ConnectError(
                "no EtherCAT slave answers",
                {self._path(): "check that the first slave has power and its IN port is connected"},
            )
        self._each("the slaves are not the configured ones", self._slaves, self._identify)
        used = {slave.number for slave in self._slaves}
        for number in sorted(set(range(found)) - used):
            log.warning("slave is not in the descriptor", slave=number, bus=self._path())

    def start(self, timeout_s: float) -> None:
        """Configure the slaves and bring them to Op. Nothing moves: all servos stay off.

        Args:
            timeout_s: slaves that will not be configured by then fail a little earlier.
        """
        limit_s = start_limit(timeout_s, self._plan.options.sdo_timeout_s)
        self._pace.limit(limit_s)
        try:
            self._configure_all()
        finally:
            self._pace.limit()
        self._exchange.needed = self._bus.expected_counter
        self._exchange.begin()
        self._set_watchdogs()
        self._start_clocks()
        self._reach(AlState.SAFE_OP)
        self._reach(AlState.OP, exchanging=True)
        for slave in self._slaves:
            slave.online, slave.fault = True, ""
        self._exchange.go_live()

    def _configure_all(self) -> None:
        """Bring the slaves to PreOp, configure and map them."""
        self._prepare()
        try:
            self._bus.map()
        except MappingError as error:
            self._map_by_plain_sdo(error)
        self._each("the mapping is wrong", self._slaves, self._check_sizes)

    def stop(self) -> None:
        """Bring all slaves to PreOp, without waiting."""
        self._bus.request(AlState.PRE_OP)

    def _identify(self, slave: Slave) -> None:
        found = len(self._bus.slaves)
        if slave.number >= found:
            last = f"slave {found - 1} ({self._bus.slaves[-1].name})"
            raise OperationError(
                f"missing: the bus has {found} slaves, 0 to {found - 1};"
                f" check cable and power behind {last}"
            )
        slave.identify()

    def _configure(self, slave: Slave) -> None:
        slave.write_startup()
        if not slave.is_drive:
            return
        axes = [options for options in slave.options if isinstance(options, AxisOptions)]
        if outputs := [pdo for options in axes for pdo in options.rx_pdos]:
            write_mapping(slave, Assignment.OUTPUTS, outputs)
        if inputs := [pdo for options in axes for pdo in options.tx_pdos]:
            write_mapping(slave, Assignment.INPUTS, inputs)
        rx_pdos = read_mapping(slave, Assignment.OUTPUTS)
        tx_pdos = read_mapping(slave, Assignment.INPUTS)
        self._require_objects(slave, rx_pdos, tx_pdos)
        slave.image.set_layout(rx_pdos, tx_pdos)
        self._take_present_outputs(slave)
        for axis in self._axes:
            if axis.drive.node is slave:
                axis.drive.find_slots()
                set_up(axis, self._plan.period_s)

    def _require_objects(
        self, slave: Slave, rx_pdos: Sequence[Pdo], tx_pdos: Sequence[Pdo]
    ) -> None:
        for options in slave.options:
            if not isinstance(options, AxisOptions):
                continue
            for key, assignment, pdos, needed in (
                ("rx_pdos", Assignment.OUTPUTS, rx_pdos, needed_outputs(options)),
                ("tx_pdos", Assignment.INPUTS, tx_pdos, needed_inputs(options)),
            ):
                held = {entry.index for pdo in pdos for entry in pdo.entries}
                offset = options.axis_offset
                missing = [index for index in needed if on_axis(index, offset) not in held]
                if missing:
                    names = ", ".join(f"0x{pdo.index:04X}" for pdo in pdos) or "none"
                    raise OperationError(
                        f"mapping: no PDO in 0x{assignment:04X} ({names}) holds"
                        f" {missing_text(missing, options.axis_offset)}; give {key}"
                    )
                entries = [entry for pdo in pdos for entry in pdo.entries]
                bits = [
                    (entry.index - offset * AXIS_STEP, entry.index, entry.bits) for entry in entries
                ]
                for what in narrow_positions(bits):
                    raise OperationError(f"mapping: {what}")

    def _take_present_outputs(self, slave: Slave) -> None:
        """Begin with the drive's own values: a mapped limit of 0 would stop it.

        The controlword begins with 0, so that no drive is enabled by its first frame.
        """
        controlwords = [on_axis(CONTROLWORD, axis) for axis in range(MAX_AXES)]
        for (index, sub), slot in slave.image.output_slots.items():
            value = 0 if index in controlwords else slave.read(index, sub)
            slave.image.outputs[slot] = value

    def _prepare(self) -> None:
        self._reach(AlState.PRE_OP)
        self._each("the slaves cannot be configured", self._slaves, self._configure)

    def _map_by_plain_sdo(self, failure: MappingError) -> None:
        """Map again, without complete access to the slaves that failed.

        Devices announce it and answer it badly, for example without the byte that pads subindex 0.
        """
        bus = self._bus
        try:
            if not failure.slaves - bus.plain_sdo:
                raise failure
            bus.plain_sdo |= failure.slaves
            names = {slave.number: slave.name for slave in self._slaves}
            log.warning(
                "no complete access from now on; complete_access: false avoids this second try",
                slaves=[names.get(one, f"slave {one}") for one in sorted(failure.slaves)],
                reason=failure.reason,
            )
            self.identify()
            self._prepare()
            bus.map()
        except MappingError as error:
            raise ConnectError(
                "the bus cannot be configured", {self._path(): str(error)}
            ) from error

    def _check_sizes(self, slave: Slave) -> None:
        raw, image, module = self._bus.slaves[slave.number], slave.image, slave.module
        sizes = len(raw.output), len(raw.input)
        if module is not None:
            expected, source = (module.output_length, module.input_length), "the options give"
        else:
            expected, source = (image.output_size, image.input_size), "its PDOs hold"
        if sizes != expected:
            raise OperationError(
                f"mapping: the slave exchanges {sizes[0]} bytes of outputs and {sizes[1]} of"
                f" inputs, {source} {expected[0]} and {expected[1]}"
            )
        slave.sizes = sizes
        slave.counter = full_counter(*sizes)

    def _set_watchdogs(self) -> None:
        milliseconds = self._plan.options.watchdog_ms
        for slave in self._slaves if milliseconds is not None else ():
            self._bus.set_watchdog(slave.number, milliseconds or 0.0)

    def _start_clocks(self) -> None:
        options = self._plan.options
        drives = [slave.number for slave in self._slaves if slave.is_drive]
        self.clocks = slaves_with_clocks(self._bus, drives)
        period_ns = round(self._plan.period_s * NANOSECONDS)
        shift_ns = round(options.sync0_shift_s * NANOSECONDS)
        for number in self.clocks:  # a clock that makes pulses must not be set
            self._bus.set_sync0(number, period_ns, shift_ns, active=False)
        if self.clocks:
            self._bus.find_clocks()
        self._exchange_periods()  # frames align the clocks; SYNC0 begins at their common time
        active = options.clocks is Clocks.SYNC0
        for number in self.clocks if active else ():
            self._bus.set_sync0(number, period_ns, shift_ns, active=True)
        if active and len(self.clocks) < len(drives):
            without = [number for number in drives if number not in self.clocks]
            log.warning("drives without a distributed clock act on the frame", slaves=without)

    def _reach(self, state: AlState, *, exchanging: bool = False) -> None:
        """Request ``state`` of all slaves and wait for it, ``exchanging`` process data."""
        timeout_s = self._plan.options.state_timeout_s
        if exchanging:
            self._exchange_periods()
        self._bus.request(state, acknowledge=not exchanging)

        def ended() -> bool:
            if exchanging:
                self._exchange_periods()
            return self._read_states(state)

        wait_until(ended, timeout_s, self._clock, _POLL_S)
        self._each(f"the slaves do not go to {state.text}", self._slaves, self._require(state))

    def _exchange_periods(self) -> None:
        """Exchange process data for some periods, at even distances: drives measure them."""
        period_ns = round(self._plan.period_s * NANOSECONDS)
        due_ns = self._clock.now_ns()
        for _ in range(_EXCHANGED_PERIODS):
            self._exchange.run_once()
            due_ns += period_ns
            self._clock.sleep_until_ns(due_ns)

    def _read_states(self, state: AlState) -> bool:
        """Read all states; True once every slave is in ``state`` or reports an error."""
        states = self._bus.states()
        ended = True
        for slave in self._slaves:
            found = states[slave.number]
            slave.state, slave.al_code = found.state, found.code if found.error else 0
            ended = ended and (found.state is state or found.error)
        return ended

    def _require(self, state: AlState) -> Callable[[Slave], None]:
        def check(slave: Slave) -> None:
            if slave.state is state and not slave.al_code:
                return
            limit_s = self._plan.options.state_timeout_s
            reason = al_code_text(slave.al_code) or (
                f"no error within {limit_s:g} s; raise state_timeout_s if it boots longer"
            )
            raise OperationError(
                f"{state.text} requested, the slave is in {slave.state.text}: {reason}"
            )

        return check

    def _each(self, message: str, slaves: Sequence[Slave], step: Callable[[Slave], None]) -> None:
        failures: dict[str, str] = {}
        for slave in slaves:
            try:
                step(slave)
            except RobotdError as error:
                slave.fault = error.reason.removeprefix(f"{slave.name}: ")
                failures[f"{self._path()} → {slave.name}"] = slave.fault
        if failures:
            raise ConnectError(message, failures)

    def _path(self) -> str:
        return f"ethercat → {self._plan.bus_name}"
