"""Connection life cycle: idle → connected (RUNNING) → communicating."""

from __future__ import annotations

import threading
from collections.abc import Callable

from robotd.api import (
    Clock,
    ConnectError,
    ConnectionState,
    DeviceDriver,
    DeviceTimeout,
    NotReady,
    get_logger,
    wait_until,
)
from robotd_franka.arm_link import FAILURES, ArmLink, ArmState
from robotd_franka.hand import FrankaHand
from robotd_franka.options import FrankaOptions

log = get_logger("franka")

CLOSE_S = 3.0  # for the arm to come to rest


class FrankaDevice(DeviceDriver):
    """The control unit of one arm. The driver of the axes uses its ``link``.

    Attributes:
        communicating: values and targets are exchanged.
        switching: held by what switches the impedance controller.
        hand: None where the arm has none.
        payload: that the arm compensates while it communicates.
    """

    def __init__(self, options: FrankaOptions, clock: Clock) -> None:
        self.communicating = False
        self.options, self.clock = options, clock
        self.switching = threading.Lock()  # each command sees the effect of the one before
        self.payload = options.payload
        self.hand = FrankaHand(options.model, options.hand, clock) if options.hand else None
        self._link: ArmLink | None = None

    @property
    def link(self) -> ArmLink:
        """The connection. Raises NotReady while it is not there."""
        if self._link is None or self._link.failure:
            raise NotReady(self.fault() or "the arm is not connected")
        return self._link

    @property
    def live(self) -> ArmLink | None:
        """The connection while its values count, else None. Never blocks."""
        return self._link if self.communicating else None

    def open(self, path: str = "", name: str = "") -> None:
        if self.state() is not ConnectionState.IDLE:
            return
        self._disconnect()  # what is left of a lost connection
        options = self.options.model_copy(update={"address": path} if path else {})
        if not options.address:
            advice = "--set backends.franka.address=ADDRESS"
            raise ConnectError("no arm is named", {"backends.franka.address": advice})
        self._link = ArmLink(options, self.clock)
        try:
            if self.hand is not None:
                self.hand.open(options.address)
        except ConnectError:
            self._disconnect()  # the next try begins anew
            raise

    def close(self) -> None:
        self.stop_communication(CLOSE_S)
        self._disconnect()
        self.payload = self.options.payload

    def start_communication(self, timeout_s: float) -> None:
        began_ns = self.clock.now_ns()
        self.wait_for(lambda state: state.time_ns > began_ns, timeout_s, "a state of the arm")
        self.link.configure(self.payload)
        self.communicating = True

    def stop_communication(self, timeout_s: float) -> None:
        if not self.communicating:
            return
        self.communicating = False
        try:
            self.end_following(timeout_s)
        except (NotReady, DeviceTimeout) as error:
            log.warning("the arm may not have come to rest", reason=str(error))

    def state(self) -> ConnectionState:
        if self._link is None or self._link.failure:
            return ConnectionState.IDLE
        return ConnectionState.COMMUNICATING if self.communicating else ConnectionState.RUNNING

    def fault(self) -> str:
        return self._link.silence if self._link else ""

    def scan_network(self) -> str:
        state = self.link.state
        joints = "" if state is None else ", ".join(f"{angle:.3f}" for angle in state.position)
        return f"arm at {self.options.address}, joints at {joints} rad"

    def follow(self, timeout_s: float) -> None:
        """Start the impedance controller and wait until the arm shows it. Hold ``switching``."""
        self.link.follow()
        self.wait_for(lambda state: state.followed, timeout_s, "the controller")

    def end_following(self, timeout_s: float) -> None:
        """End the impedance controller and wait until the arm shows it.

        Raises NotReady: the connection is lost. DeviceTimeout: the arm does not show it.
        """
        link = self.link
        try:
            link.end_following()
        except FAILURES as error:
            log.info("the motion had ended already", reason=str(error))
        began_ns = self.clock.now_ns()
        self.wait_for(
            lambda state: state.time_ns > began_ns and not state.followed,
            timeout_s,
            "the end of the motion",
        )

    def wait_for(self, condition: Callable[[ArmState], bool], timeout_s: float, what: str) -> None:
        """Wait for a state for which ``condition`` is true.

        Raises DeviceTimeout: no such state came. NotReady: the connection is lost.
        """

        def found() -> bool:
            state = self.link.state
            return state is not None and condition(state)

        if not wait_until(found, timeout_s, self.clock):
            raise DeviceTimeout(f"waited {timeout_s:g} s for {what}")

    def _disconnect(self) -> None:
        self.communicating = False
        if self.hand is not None:
            self.hand.close()
        link, self._link = self._link, None
        if link is not None:
            link.close()
