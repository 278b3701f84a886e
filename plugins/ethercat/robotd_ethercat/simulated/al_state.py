"""AL state machine of a slave, with status codes (ETG.1000.6 and ETG.1020)."""

from __future__ import annotations

from enum import IntEnum
from typing import Protocol

from robotd_ethercat.simulated import registers as reg
from robotd_ethercat.simulated.slave_controller import SlaveController

_ACKNOWLEDGE, _ERROR, _STATE = 0x10, 0x10, 0x0F
OUTPUT_TIMEOUT_NS = 2_000_000_000  # for the first outputs after a request of Op


class AlState(IntEnum):
    """AL states, as in the AL control and AL status registers."""

    INIT = 1
    PRE_OP = 2
    BOOT = 3
    SAFE_OP = 4
    OP = 8


class AlCode(IntEnum):
    """AL status codes that the simulated slaves report."""

    NONE = 0x0000
    INVALID_STATE_CHANGE = 0x0011
    UNKNOWN_STATE = 0x0012
    BOOT_NOT_SUPPORTED = 0x0013
    INVALID_MAILBOX = 0x0016
    INVALID_SYNC_MANAGER = 0x0017
    NO_VALID_OUTPUTS = 0x0019
    SYNCHRONISATION_ERROR = 0x001A
    WATCHDOG = 0x001B
    INVALID_OUTPUT_CONFIGURATION = 0x001D
    INVALID_INPUT_CONFIGURATION = 0x001E
    INVALID_INPUT_MAPPING = 0x0024
    INVALID_OUTPUT_MAPPING = 0x0025
    FATAL_SYNC_ERROR = 0x002C
    PLL_ERROR = 0x0032
    INVALID_DC_CYCLE = 0x0035


_UPWARDS = {
    (AlState.INIT, AlState.PRE_OP),
    (AlState.PRE_OP, AlState.SAFE_OP),
    (AlState.SAFE_OP, AlState.OP),
}


class Application(Protocol):
    """Device behind the state machine."""

    @property
    def needs_outputs(self) -> bool:
        """True if Op needs outputs of the master."""

    def check(self, target: AlState) -> AlCode:
        """Check the configuration for an upward transition to ``target``."""

    def entered(self, state: AlState, before: AlState) -> None:
        """Act on a new state."""


class AlStateMachine:
    """States Init, PreOp, SafeOp and Op; used by the thread of the simulation.

    Attributes:
        state: present state.
        code: AL status code, AlCode.NONE without an error.
        error: error bit, until the master acknowledges.
    """

    def __init__(self, controller: SlaveController, application: Application) -> None:
        self._controller, self._application = controller, application
        self.state = AlState.INIT
        self.error, self.code = False, int(AlCode.NONE)
        self._op_requested_ns: int | None = None
        self._show()

    def request(self, control: int, now_ns: int) -> None:
        """Handle a value of the AL control register."""
        acknowledged = bool(control & _ACKNOWLEDGE)
        requested = control & _STATE
        if self.error and not acknowledged and requested >= self.state:
            return
        if acknowledged:
            self.error, self.code = False, int(AlCode.NONE)
        self._op_requested_ns = None
        if requested not in AlState.__members__.values():
            self._reject(AlCode.UNKNOWN_STATE)
            return
        self._change(AlState(requested), now_ns)
        self._show()

    def outputs_received(self) -> None:
        """Finish a pending transition to Op: outputs are valid now."""
        if self._op_requested_ns is not None:
            self._op_requested_ns = None
            self._enter(AlState.OP)
            self._show()

    def tick(self, now_ns: int) -> None:
        """Give up a transition to Op without outputs."""
        since_ns = self._op_requested_ns
        if since_ns is not None and now_ns - since_ns > OUTPUT_TIMEOUT_NS:
            self._op_requested_ns = None
            self._reject(AlCode.NO_VALID_OUTPUTS)

    def fail(self, code: int, fallback: AlState = AlState.SAFE_OP) -> None:
        """Report an error: fall back to at most ``fallback`` with the error bit."""
        self._op_requested_ns = None
        if self.state > fallback:
            self._enter(fallback)
        self._reject(code)

    def _change(self, target: AlState, now_ns: int) -> None:
        if target is AlState.BOOT:
            self._reject(AlCode.BOOT_NOT_SUPPORTED)
        elif target <= self.state:
            if target is not self.state:
                self._enter(target)
        elif (self.state, target) not in _UPWARDS:
            self._reject(AlCode.INVALID_STATE_CHANGE)
        else:
            code = self._application.check(target)
            if code is not AlCode.NONE:
                self._reject(code)
            elif target is AlState.OP and self._application.needs_outputs:
                self._op_requested_ns = now_ns
            else:
                self._enter(target)

    def _enter(self, state: AlState) -> None:
        before, self.state = self.state, state
        self._application.entered(state, before)

    def _reject(self, code: int) -> None:
        self.error, self.code = True, int(code)
        self._show()

    def _show(self) -> None:
        status = self.state | (_ERROR if self.error else 0)
        self._controller.put(reg.AL_STATUS, 2, status)
        self._controller.put(reg.AL_STATUS_CODE, 2, self.code)
