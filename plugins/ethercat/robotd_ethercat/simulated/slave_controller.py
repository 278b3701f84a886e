"""EtherCAT slave controller (ESC): memory, registers and access rules."""

from __future__ import annotations

from collections.abc import Callable

from robotd_ethercat.simulated import registers as reg
from robotd_ethercat.simulated.distributed_clock import DistributedClock
from robotd_ethercat.simulated.sync_manager import Fmmu, SyncManager

_WRITABLE = reg.writable_mask()
_FEATURES = 0x000C  # distributed clocks, 64 bit wide
_PORTS = 0x0F  # ports 0 and 1: MII, others not implemented
_DC_AREA = range(reg.DC_SYSTEM_TIME, reg.DC_SYSTEM_TIME + 8)
_CONFIGURATION = range(reg.FMMU, reg.SYNC_MANAGER + reg.SYNC_MANAGER_SIZE * reg.SYNC_MANAGER_COUNT)
_TIME_SIZES = (4, 8)  # bytes of a distributed system time
_ALIAS_ENABLED = 0x01  # bit 24 of the DL control register
_LINKED, _OPEN_PORT = 0x10, 0x02
_READ, _WRITE, _RELOAD = 1, 2, 4
_WRITE_ENABLE, _EIGHT_BYTES, _ADDRESS_BYTES = 0x0001, 0x0040, 0x0080
_COMMAND_ERROR = 0x2000
_WORDS = 0x1_0000


class EepromInterface:
    """Word access by the registers 0x0500 to 0x050F; 8 bytes are read at a time."""

    def __init__(self, memory: bytearray, image: bytearray) -> None:
        self._memory = memory
        self.image = image
        self._status(0)

    def command(self) -> None:
        """Carry out the command in the control register."""
        memory = self._memory
        control = int.from_bytes(memory[reg.EEPROM_CONTROL : reg.EEPROM_CONTROL + 2], "little")
        word = int.from_bytes(memory[reg.EEPROM_ADDRESS : reg.EEPROM_ADDRESS + 4], "little")
        command = control >> 8 & 7
        error = 0
        if command == _READ:
            data = bytes(self.image[2 * word : 2 * word + 8]) if word < _WORDS else b""
            memory[reg.EEPROM_DATA : reg.EEPROM_DATA + 8] = data.ljust(8, b"\xff")
        elif command == _WRITE and control & _WRITE_ENABLE and 2 * word + 2 <= len(self.image):
            self.image[2 * word : 2 * word + 2] = memory[reg.EEPROM_DATA : reg.EEPROM_DATA + 2]
        elif command not in (0, _RELOAD):
            error = _COMMAND_ERROR
        self._status(error)

    def _status(self, error: int) -> None:
        status = _EIGHT_BYTES | _ADDRESS_BYTES | error
        self._memory[reg.EEPROM_CONTROL : reg.EEPROM_CONTROL + 2] = status.to_bytes(2, "little")


class SlaveController:
    """Memory and registers of one slave; used by the thread of the simulation alone.

    Attributes:
        memory: registers, then process RAM; keep its identity, views of it are cached.
        clock: distributed clock.
        eeprom: SII image behind the EEPROM interface.
        sync_managers: SM0 to SM7.
        station: addresses that it answers to, set by the master or as alias.
        al_request: last AL control word, not yet handled by the application; None without one.
        mailbox_event: a mailbox was written or read since the application looked.
        output_event: outputs were written since the application looked.
        watchdog_ns: time of the last write to outputs with the watchdog enabled.
        arrival_ns, return_ns: delay of a frame to port 0 and, on its way back, to port 1; None:
            it does not come back there.
        on_configured: called when FMMUs, SyncManagers or addresses change.
    """

    def __init__(self, image: bytearray, now_ns: int) -> None:
        self.memory = bytearray(reg.MEMORY_SIZE)
        self.on_configured: Callable[[], None] = lambda: None
        self._power_on_defaults()
        self.clock = DistributedClock(self.memory, now_ns)
        self.eeprom = EepromInterface(self.memory, image)
        self.sync_managers = [
            SyncManager(self.memory, number) for number in range(reg.SYNC_MANAGER_COUNT)
        ]
        self.arrival_ns = 0
        self.return_ns: int | None = None
        self.station: frozenset[int] = frozenset()
        self.al_request: int | None = None
        self.mailbox_event = self.output_event = self.repeat_request = False
        self.watchdog_ns = now_ns
        alias = int.from_bytes(image[8:10], "little")
        self.put(reg.STATION_ALIAS, 2, alias)
        self._update_station()

    def get(self, address: int, length: int) -> int:
        """Return a register as a number."""
        return int.from_bytes(self.memory[address : address + length], "little")

    def put(self, address: int, length: int, value: int) -> None:
        """Set a register from the side of the slave."""
        self.memory[address : address + length] = value.to_bytes(length, "little")

    def set_links(self, upstream: bool, downstream: bool) -> None:
        """Set the DL status of ports 0 and 1; a lost link is counted."""
        before = self.get(reg.DL_STATUS, 2)
        status = 0x0001  # EEPROM loaded
        for port, linked in enumerate((upstream, downstream, False, False)):
            link, state = _LINKED << port, (1 if not linked else _OPEN_PORT) << 8 + 2 * port
            status |= state | (link if linked else 0)
            if before & link and not linked:
                self.count_error(reg.LOST_LINKS + port)
        self.put(reg.DL_STATUS, 2, status)

    def count_error(self, address: int) -> None:
        """Increment an error counter, which stops at 255."""
        self.memory[address] = min(255, self.memory[address] + 1)

    def read(self, address: int, length: int, now_ns: int) -> bytes | None:
        """Return memory as the master reads it; None if the access is not successful."""
        if address + length > reg.MEMORY_SIZE:
            return None
        if address < reg.PROCESS_RAM:
            if address < _DC_AREA.stop and address + length > _DC_AREA.start:
                self.clock.refresh(now_ns + self.arrival_ns)
            return bytes(self.memory[address : address + length])
        manager = self._manager(address, length)
        if manager is not None and not manager.allows_read(address, length):
            return None
        data = bytes(self.memory[address : address + length])
        if manager is not None and manager.mailbox and address + length >= manager.end:
            manager.full = False
            self.mailbox_event = True
        return data

    def write(self, address: int, data: bytes, now_ns: int) -> bool:
        """Write memory as the master does; return True if the access is successful."""
        length = len(data)
        if address + length > reg.MEMORY_SIZE:
            return False
        if address < reg.PROCESS_RAM:
            return self._write_registers(address, data, now_ns)
        manager = self._manager(address, length)
        if manager is not None and not manager.allows_write(address, length):
            return False
        self.memory[address : address + length] = data
        if manager is not None and address + length >= manager.end:
            self.written(manager, now_ns)
        return True

    def written(self, manager: SyncManager, now_ns: int) -> None:
        """Note that the last byte of ``manager`` was written."""
        if manager.mailbox:
            manager.full = True
            self.mailbox_event = True
        else:
            self.output_event = True
            if manager.watchdog:
                self.watchdog_ns = now_ns

    def fmmus(self) -> list[Fmmu]:
        """Return the active FMMUs."""
        areas = (
            self.memory[start : start + reg.FMMU_SIZE]
            for start in range(reg.FMMU, reg.FMMU + reg.FMMU_SIZE * reg.FMMU_COUNT, reg.FMMU_SIZE)
        )
        return [fmmu for fmmu in map(Fmmu.of, areas) if fmmu is not None]

    def watchdog_time_ns(self) -> int:
        """Process data watchdog: base (divider + 2) × 40 ns, times 0x0420; 0: disabled."""
        base_ns = (self.get(reg.WATCHDOG_DIVIDER, 2) + 2) * 40
        return base_ns * self.get(reg.PROCESS_DATA_WATCHDOG_TIME, 2)

    def deactivate(self, number: int, inactive: bool) -> None:
        """Deactivate a SyncManager from the side of the slave."""
        self.sync_managers[number].deactivate(inactive)
        self.on_configured()

    def _manager(self, address: int, length: int) -> SyncManager | None:
        for manager in self.sync_managers:
            if manager.overlaps(address, length):
                return manager
        return None

    def _write_registers(self, address: int, data: bytes, now_ns: int) -> bool:
        end = min(address + len(data), reg.PROCESS_RAM)
        if 1 not in _WRITABLE[address:end]:
            return False
        for position in range(address, end):
            if _WRITABLE[position]:
                self.memory[position] = data[position - address]
        self._act_on_registers(address, end)
        if address == reg.DC_SYSTEM_TIME and len(data) in _TIME_SIZES:
            self.clock.received = data, now_ns + self.arrival_ns
        if address <= reg.DC_RECEIVE_TIMES < end:
            self._latch(now_ns)
        return True

    def _latch(self, now_ns: int) -> None:
        """Store the receive times of the frame that is being processed."""
        times = {0: now_ns + self.arrival_ns}
        if self.return_ns is not None:
            times[1] = now_ns + self.return_ns
        self.clock.latch(now_ns + self.arrival_ns, times)

    def _act_on_registers(self, start: int, end: int) -> None:
        """Carry out the side effects of a write to registers."""
        if start < reg.DL_CONTROL + 4 and end > reg.STATION_ADDRESS:
            self._update_station()
        if start <= reg.AL_CONTROL < end:
            self.al_request = self.get(reg.AL_CONTROL, 2)
        if start < reg.LOST_LINKS + 4 and end > reg.RX_ERRORS:
            self._clear_counters(start)
        if start <= reg.EEPROM_CONTROL + 1 < end:
            self.eeprom.command()
        if start < _CONFIGURATION.stop and end > _CONFIGURATION.start:
            self._configure()

    def _configure(self) -> None:
        for manager in self.sync_managers:
            if manager.configure():
                self.repeat_request = True
        self.on_configured()

    def _update_station(self) -> None:
        addresses = {self.get(reg.STATION_ADDRESS, 2)}
        if self.memory[reg.DL_CONTROL + 3] & _ALIAS_ENABLED:
            addresses.add(self.get(reg.STATION_ALIAS, 2))
        self.station = frozenset(addresses - {0})
        self.on_configured()

    def _clear_counters(self, start: int) -> None:
        if start >= reg.LOST_LINKS:
            self.memory[reg.LOST_LINKS : reg.LOST_LINKS + 4] = bytes(4)
        else:
            self.memory[reg.RX_ERRORS : reg.PROCESSING_ERRORS + 2] = bytes(14)
            self.memory[reg.LOST_LINKS : reg.LOST_LINKS + 4] = bytes(4)

    def _power_on_defaults(self) -> None:
        memory = self.memory
        # Type, revision, build, FMMUs, SyncManagers, RAM in KiB, ports, features.
        memory[0:8] = bytes([0x11, 0x00, 0x02, 0x00, 8, 8, 8, _PORTS])
        self.put(0x0008, 2, _FEATURES)
        self.put(reg.AL_STATUS, 2, 1)
        self.put(reg.PDI_CONTROL, 1, 0x08)  # 16 bit microcontroller
        self.put(reg.WATCHDOG_DIVIDER, 2, 0x09C2)  # 100 µs
        self.put(reg.PDI_WATCHDOG_TIME, 2, 1000)
        self.put(reg.PROCESS_DATA_WATCHDOG_TIME, 2, 1000)  # 100 ms
        self.put(reg.PROCESS_DATA_WATCHDOG_STATUS, 2, 1)
        self.put(0x0934, 2, 0x0C04)
