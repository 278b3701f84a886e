"""SyncManager: consistent memory between master and slave, buffered or as a mailbox."""

from __future__ import annotations

from robotd_ethercat.simulated import registers as reg

_MAILBOX, _TO_SLAVE, _WATCHDOG = 0x02, 0x04, 0x40
_FULL = 0x08
_ACTIVE, _REPEAT = 0x01, 0x02


class SyncManager:
    """One SyncManager; its registers are in the memory of the slave controller.

    Buffered mode is exchanged frame by frame: a frame is processed as a whole, so that the three
    buffers of a real controller are not needed for consistency.

    Attributes:
        start, length: physical area, bytes.
        mailbox: mailbox mode, with a full/empty handshake; else buffered.
        to_slave: written by the master.
        watchdog: writes restart the process data watchdog.
        activated: activated by the master.
        active: activated, and not deactivated by the slave.
    """

    def __init__(self, memory: bytearray, number: int) -> None:
        self._memory = memory
        self._base = reg.SYNC_MANAGER + reg.SYNC_MANAGER_SIZE * number
        self.configure()

    def configure(self) -> bool:
        """Read the registers again; return True if the master toggled the repeat request."""
        memory, base = self._memory, self._base
        self.start = int.from_bytes(memory[base : base + 2], "little")
        self.length = int.from_bytes(memory[base + 2 : base + 4], "little")
        control = memory[base + 4]
        self.mailbox = control & 3 == _MAILBOX
        self.to_slave = bool(control & _TO_SLAVE)
        self.watchdog = bool(control & _WATCHDOG)
        self.activated = bool(memory[base + 6] & _ACTIVE) and self.length > 0
        self.active = self.activated and not memory[base + 7] & _ACTIVE
        if not self.active:
            self.full = False
        return bool((memory[base + 6] ^ memory[base + 7]) & _REPEAT)

    @property
    def end(self) -> int:
        """First address behind the area."""
        return self.start + self.length

    @property
    def full(self) -> bool:
        """Mailbox mode: a message waits for its reader."""
        return bool(self._memory[self._base + 5] & _FULL)

    @full.setter
    def full(self, full: bool) -> None:
        status = self._memory[self._base + 5]
        self._memory[self._base + 5] = status | _FULL if full else status & ~_FULL

    def deactivate(self, inactive: bool) -> None:
        """Deactivate the SyncManager from the side of the slave, or allow it again."""
        control = self._memory[self._base + 7]
        self._memory[self._base + 7] = control & ~_ACTIVE | int(inactive)
        self.configure()

    def acknowledge_repeat(self) -> None:
        """Answer a repeat request: the last message is in the mailbox again."""
        activate, control = self._memory[self._base + 6], self._memory[self._base + 7]
        self._memory[self._base + 7] = control & ~_REPEAT | activate & _REPEAT

    def overlaps(self, address: int, length: int) -> bool:
        """Return True if the area shares a byte with ``address`` …."""
        return self.active and address < self.end and self.start < address + length

    def allows_read(self, address: int, length: int) -> bool:
        """Return True if the master may read: buffered, or a full mailbox from its start."""
        if not self.mailbox:
            return True
        return not self.to_slave and self.full and address == self.start

    def allows_write(self, address: int, length: int) -> bool:
        """Return True if the master may write: outputs, or an empty mailbox from its start."""
        if not self.to_slave:
            return False
        return not self.mailbox or (not self.full and address == self.start)
