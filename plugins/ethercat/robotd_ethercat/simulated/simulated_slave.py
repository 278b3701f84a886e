"""Simulated slave: the application behind a slave controller."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence

from robotd_ethercat.simulated import registers as reg
from robotd_ethercat.simulated.al_state import AlCode, AlState, AlStateMachine
from robotd_ethercat.simulated.mailbox import Mailbox
from robotd_ethercat.simulated.object_access import ObjectAccess, SlaveFaults
from robotd_ethercat.simulated.object_dictionary import ObjectDefinition, ObjectDictionary
from robotd_ethercat.simulated.pdo_image import PdoImage
from robotd_ethercat.simulated.sdo_server import SdoInformation, SdoServer
from robotd_ethercat.simulated.sii_content import Hardware, Identity, change_identity, sii_image
from robotd_ethercat.simulated.slave_controller import SlaveController
from robotd_ethercat.simulated.standard_objects import ERROR_SETTINGS, standard_objects

MAILBOX_BYTES = 256
Command = Callable[[list[str]], str | None]
_COE_SDO, _COE_INFORMATION = 2, 8
_EMERGENCY = (1 << 12).to_bytes(2, "little")
_OUT, _IN = 2, 3  # SyncManagers of the process data
_SYNC0_UNIT_NS = 100_000  # shortest SYNC0 cycle that is accepted
_MISSED, _GOOD = 3, 1  # added for a missed SYNC0 period, subtracted for a good one (ETG.1020)


class SyncSupervision:
    """Checks in Op that outputs come in time and the clock is synchronous.

    Time in which the simulation itself did not run is left out: call ``skip``.

    Attributes:
        error_limit: sync error counter limit, as object 0x10F1:02; 0: periods without outputs
            are allowed, as patient drives do.
    """

    def __init__(self, controller: SlaveController, error_limit: int) -> None:
        self._controller = controller
        self.error_limit = error_limit
        self._pulse: int | None = None
        self._errors = 0

    def begin(self, now_ns: int) -> None:
        """Start supervision: the slave enters Op."""
        self._controller.watchdog_ns = now_ns
        self._controller.clock.difference_ns = None
        self._pulse, self._errors = None, 0

    def skip(self, paused_ns: int) -> None:
        """Leave out a pause of the simulation."""
        self._controller.watchdog_ns += paused_ns
        cycle = self._controller.clock.sync0_cycle_ns
        if self._pulse is not None and cycle:
            self._pulse += -(-paused_ns // cycle)

    def outputs(self, now_ns: int) -> AlCode:
        """Check the arrival of outputs; return AlCode.NONE if all is well."""
        clock = self._controller.clock
        if not clock.sync0_active:
            return AlCode.NONE
        pulse = clock.sync0_count(now_ns)
        if pulse is None:
            return AlCode.FATAL_SYNC_ERROR
        if self.error_limit and self._misses_periods(pulse):
            return AlCode.SYNCHRONISATION_ERROR
        difference_ns = abs(clock.difference_ns or 0)
        return AlCode.PLL_ERROR if 2 * difference_ns > clock.sync0_cycle_ns else AlCode.NONE

    def _misses_periods(self, pulse: int) -> bool:
        """Count periods without outputs; return True above the limit."""
        before, self._pulse = self._pulse, pulse
        missed = 0 if before is None else max(0, pulse - before - 1)
        self._errors = max(0, self._errors + _MISSED * missed - (0 if missed else _GOOD))
        return self._errors > self.error_limit

    def tick(self, now_ns: int) -> AlCode:
        """Check the process data watchdog."""
        controller = self._controller
        time_ns = controller.watchdog_time_ns()
        expired = (
            controller.sync_managers[2].watchdog
            and time_ns > 0
            and now_ns - controller.watchdog_ns > time_ns
        )
        controller.put(reg.PROCESS_DATA_WATCHDOG_STATUS, 2, int(not expired))
        if expired:
            controller.count_error(reg.PROCESS_DATA_WATCHDOG_COUNTER)
        return AlCode.WATCHDOG if expired else AlCode.NONE


class Slave:
    """One slave with mailbox, process data and supervision.

    A device overrides ``process_outputs`` and ``update_inputs``. Used by the thread of the
    simulation alone.

    Args:
        identity: vendor, product, revision, serial number.
        name: shown in SII and object 0x1008.
        objects: objects of the device, with its PDO mapping and assignment.
        now_ns: time of power-on.
        alias: configured station alias.
    """

    def __init__(
        self,
        identity: Identity,
        name: str,
        objects: Sequence[ObjectDefinition],
        now_ns: int,
        *,
        alias: int = 0,
    ) -> None:
        self.identity = identity
        self.faults = SlaveFaults()
        self.objects = ObjectDictionary([*standard_objects(identity, name), *objects])
        self.outputs = PdoImage(self.objects, 0x1C12)
        self.inputs = PdoImage(self.objects, 0x1C13)
        hardware = Hardware(name, MAILBOX_BYTES, self.outputs.size, self.inputs.size, alias)
        self._image = sii_image(identity, hardware, self.objects)
        self.powered = True
        self.power_on(now_ns)

    def power_on(self, now_ns: int) -> None:
        """Start with the values of power-on, in Init."""
        self.powered = True
        self.objects.reset()
        for sub, value in enumerate(_parts(self.identity), start=1):
            self.objects.values[0x1018, sub] = value
        self.controller = SlaveController(self._image, now_ns)
        self.al = AlStateMachine(self.controller, self)
        self.mailbox = Mailbox(self.controller, self._on_coe)
        access = ObjectAccess(self.objects, self.faults, lambda: self.al.state, self.on_written)
        self._sdo = SdoServer(access, self.faults, lambda: self.mailbox.capacity)
        self._information = SdoInformation(self.objects, lambda: self.mailbox.capacity)
        self._supervision = SyncSupervision(self.controller, self.objects.values[ERROR_SETTINGS, 2])
        self._memory = memoryview(self.controller.memory)
        for number in (_OUT, _IN):
            self.controller.deactivate(number, inactive=True)

    def power_off(self) -> None:
        """Lose the supply: the slave is not on the bus any more."""
        self.powered = False

    @property
    def needs_outputs(self) -> bool:
        """True if Op needs outputs of the master."""
        return self.outputs.size > 0

    def service(self, now_ns: int) -> None:
        """Handle what the last frames brought."""
        controller = self.controller
        if controller.al_request is not None:
            request, controller.al_request = controller.al_request, None
            self.al.request(request, now_ns)
        if controller.mailbox_event or controller.repeat_request:
            controller.mailbox_event = False
            self.mailbox.service()

    def take_outputs(self, now_ns: int) -> bool:
        """Read new outputs; return True if the device acts on them."""
        controller = self.controller
        controller.output_event = False
        self.al.outputs_received()
        if self.al.state is not AlState.OP:
            return False
        code = self._supervision.outputs(now_ns)
        if code is not AlCode.NONE:
            self.al.fail(code)
            return False
        self.outputs.unpack(self._memory[controller.sync_managers[_OUT].start :])
        return True

    def put_inputs(self) -> None:
        """Write the inputs of the device to its process data."""
        if self.al.state in (AlState.SAFE_OP, AlState.OP) and self.inputs.size:
            self.inputs.pack(self._memory[self.controller.sync_managers[_IN].start :])

    def tick(self, now_ns: int, paused_ns: int) -> None:
        """Supervise; ``paused_ns`` is a time in which the simulation did not run."""
        if paused_ns:
            self._supervision.skip(paused_ns)
        self.al.tick(now_ns)
        if self.al.state is AlState.OP and self.needs_outputs:
            code = self._supervision.tick(now_ns)
            if code is not AlCode.NONE:
                self.al.fail(code)
        self.mailbox.service()

    def emergency(self, code: int, register: int | None = None, data: bytes = bytes(5)) -> None:
        """Send a CoE emergency, and enter it in the error register 0x1001."""
        register = int(code != 0) if register is None else register
        self.objects.values[0x1001, 0] = register
        if self.al.state is not AlState.INIT:
            self.mailbox.send(_EMERGENCY + struct.pack("<HB5s", code, register, data))

    def change_identity(self, identity: Identity) -> None:
        """Be another device: SII and object 0x1018."""
        change_identity(self._image, identity)
        for sub, value in enumerate(_parts(identity), start=1):
            self.objects.values[0x1018, sub] = value

    def check(self, target: AlState) -> AlCode:
        """Check the SyncManagers for an upward transition (protocol of the AL state machine)."""
        if target is AlState.PRE_OP:
            return self._check_mailbox()
        if target is AlState.SAFE_OP:
            return self._check_process_data()
        return AlCode.NONE

    def entered(self, state: AlState, before: AlState) -> None:
        """Activate and deactivate SyncManagers as the state needs it."""
        active = state in (AlState.SAFE_OP, AlState.OP)
        for number in (_OUT, _IN):
            self.controller.deactivate(number, inactive=not active)
        if state is AlState.INIT:
            self.mailbox.reset()
            self._sdo.reset()
        elif state is AlState.SAFE_OP:
            self.put_inputs()
        elif state is AlState.OP:
            self._supervision.error_limit = self.objects.values[ERROR_SETTINGS, 2]
            self._supervision.begin(self.controller.watchdog_ns)

    @property
    def commands(self) -> dict[str, Command]:
        """Fault commands of this device, by name; see ``fault_commands``."""
        return {}

    def on_written(self, index: int, sub: int) -> None:
        """SDO has written an object."""

    def process_outputs(self, period_s: float) -> None:
        """Act on new outputs."""

    def update_inputs(self, period_s: float) -> None:
        """Measure."""

    def _check_mailbox(self) -> AlCode:
        inbox, outbox = self.controller.sync_managers[:2]
        fits = (
            inbox.active and inbox.mailbox and inbox.to_slave and inbox.length >= 16
            and outbox.active and outbox.mailbox and not outbox.to_slave and outbox.length >= 16
        )  # fmt: skip
        return AlCode.NONE if fits else AlCode.INVALID_MAILBOX

    def _check_process_data(self) -> AlCode:
        self.outputs = PdoImage(self.objects, 0x1C12)
        self.inputs = PdoImage(self.objects, 0x1C13)
        if not self.outputs.valid:
            return AlCode.INVALID_OUTPUT_MAPPING
        if not self.inputs.valid:
            return AlCode.INVALID_INPUT_MAPPING
        for number, image, code in (
            (_OUT, self.outputs, AlCode.INVALID_OUTPUT_CONFIGURATION),
            (_IN, self.inputs, AlCode.INVALID_INPUT_CONFIGURATION),
        ):
            manager = self.controller.sync_managers[number]
            length = manager.length if manager.activated else 0
            if length != image.size or (length and manager.to_slave is not (number == _OUT)):
                return code
        clock = self.controller.clock
        if clock.sync0_active and clock.sync0_cycle_ns < _SYNC0_UNIT_NS:
            return AlCode.INVALID_DC_CYCLE
        return AlCode.NONE

    def _on_coe(self, data: bytes) -> None:
        service = data[1] >> 4
        if service == _COE_SDO:
            response = self._sdo.handle(data)
            if response is not None:
                self.mailbox.send(response)
        elif service == _COE_INFORMATION:
            for message in self._information.handle(data):
                self.mailbox.send(message)


def _parts(identity: Identity) -> tuple[int, int, int, int]:
    return identity.vendor_id, identity.product_code, identity.revision, identity.serial
