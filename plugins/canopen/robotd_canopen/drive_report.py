"""Latest report of one drive axis, decoded."""

from __future__ import annotations

from robotd_canopen.feedback import (
    DEMAND,
    ERROR_CODE,
    INPUTS,
    MODE,
    STATUSWORD,
    VELOCITY,
    Feedback,
)
from robotd_canopen.layout import AxisLayout
from robotd_canopen.node import Node
from robotd_canopen.scaling import Scaling
from robotd_canopen.state_machine import FAULTY, POWERED, DriveState, drive_state


class DriveReport:
    """State and values that the drive sent last.

    Updated by the control loop, read by any thread.

    Attributes:
        known: the node is online and every synchronous TPDO has come.
        state: UNKNOWN while the drive is not ``known``.
        statusword: object 0x6041.
        displayed_mode: object 0x6061.
    """

    def __init__(
        self, number: int, layout: AxisLayout, node: Node, feedback: Feedback, scaling: Scaling
    ) -> None:
        self.known = False
        self.state = DriveState.UNKNOWN
        self.statusword = self.displayed_mode = 0
        self._number, self._node, self._scaling = number, node, scaling
        self._feedback = feedback
        self._has_demand = any(pdo.holds(DEMAND) for pdo in layout.tpdos)

    @property
    def powered(self) -> bool:
        return self.state in POWERED

    @property
    def in_alarm(self) -> bool:
        return self.state in FAULTY

    @property
    def position(self) -> float:
        """Measured position, rad or m."""
        return float(self._feedback.counts[self._number]) * self._scaling.position

    @property
    def velocity(self) -> float:
        """Measured velocity, rad/s or m/s."""
        return self._object(VELOCITY) * self._scaling.velocity

    @property
    def error_code(self) -> int:
        """Object 0x603F."""
        return self._object(ERROR_CODE)

    @property
    def switches(self) -> tuple[bool, bool, bool]:
        """Negative limit, positive limit and home switch, by the axis' own direction."""
        inputs = self._object(INPUTS)
        negative, positive = bool(inputs & 1), bool(inputs & 2)  # as the drive counts
        if self._scaling.polarity < 0:
            negative, positive = positive, negative
        return negative, positive, bool(inputs & 4)

    @property
    def syncs(self) -> int:
        """SYNCs sent so far."""
        return self._feedback.syncs

    def demand(self) -> float:
        """Return the drive's own position command; the measured one where it reports none."""
        if self._has_demand:
            return self._feedback.demand(self._number) * self._scaling.position
        return self.position

    def update(self) -> None:
        """Control loop: decode the values taken last."""
        self.statusword = self._object(STATUSWORD)
        self.displayed_mode = self._object(MODE)
        self.known = self._node.online and self._feedback.complete(self._number)
        self.state = drive_state(self.statusword) if self.known else DriveState.UNKNOWN

    def rebase(self) -> None:
        """Worker: restart the count at a position that the drive has set."""
        self._feedback.rebase(self._number)

    def forget(self) -> None:
        """Worker: discard the values; the drive has been configured anew."""
        self._feedback.forget(self._number)

    def _object(self, index: int) -> int:
        return int(self._feedback.columns[index][self._number])
