"""Independent CiA 402 drive with a tap on each command that it executes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import can
from tests.plugins.independent.cia402_node import ENERGISED, ServoDrive, State
from tests.plugins.independent.knobs import Knobs
from tests.plugins.independent.servo_axis import CSP, CST, CSV, HOMING, PP, PV
from tests.witness.bench import RATED_TORQUE
from tests.witness.judge import Command, Judge

KINDS = {CSP: "position", CSV: "velocity", CST: "torque"}
TARGETS = {CSP: 0x607A, CSV: 0x60FF, CST: 0x6071}
OWN_PROFILES = {PP, PV, HOMING}  # the drive plans the motion


class TappedDrive(ServoDrive):
    """A drive that hands its commands to a judge.

    Args:
        counts_per_rad: of the joint; the drive's units are counts.
    """

    def __init__(
        self,
        node_id: int,
        send: Callable[[can.Message], None],
        knobs: Knobs,
        judge: Judge,
        counts_per_rad: float,
    ) -> None:
        self.judge, self._counts_per_rad = judge, counts_per_rad
        self._seen = (0, 0.0)  # mode, and counts at zero
        self._frame_s = self._data_s = 0.0  # when the present frame and the last target were sent
        super().__init__(node_id, send, knobs)

    @property
    def position_rad(self) -> float:
        return self[0x6064] / self._counts_per_rad

    def receive(self, message: can.Message, now: float) -> None:
        self._frame_s = message.timestamp
        if any(message.arbitration_id == pdo.cob_id for pdo in self.rpdos):
            self._data_s = message.timestamp
        super().receive(message, now)

    @property
    def demand_rad(self) -> float:
        """The drive's own demand, in the units of the joint."""
        units = (self.axis.demand - self.axis.counts_at_zero) * self.axis.scale
        return units / self._counts_per_rad

    def apply(self, values: list[tuple[int, int, bytes]]) -> None:
        place, zero = self.demand_rad, self.axis.counts_at_zero
        super().apply(values)
        if values:
            self.take_stock()
            if self.axis.counts_at_zero == zero:
                self.execute({index for index, _, _ in values}, place)
            self.judge.note_frame(self._data_s)

    def execute(self, written: set[int], place: float) -> None:
        """Hand over the command of this cycle.

        Args:
            written: the objects that came with it.
            place: the drive's demand before.
        """
        mode = self[0x6061]
        if mode not in KINDS or TARGETS[mode] not in written or self.power is not State.ENABLED:
            return
        if self.axis.braking is not None or self[0x6040] & 0x100:
            self.judge.own_ramp()
            return
        raw = self[TARGETS[mode]]
        target = raw * RATED_TORQUE / 1000 if mode == CST else raw / self._counts_per_rad
        if mode == CSV:
            place = self.axis.velocity * self.axis.scale / self._counts_per_rad
        word = self[0x6040]
        sent = self._frame_s, self._data_s
        self.judge.execute(Command(self.now, target, KINDS[mode], *sent, place, word, mode))

    def _go(self, state: State) -> None:
        super()._go(state)
        self.take_stock()

    def take_stock(self) -> None:
        """Report power stage, mode and own ramps to the judge."""
        mode, zero = self[0x6061], self.axis.counts_at_zero
        by_itself = self.power is not State.ENABLED or self.axis.braking is not None
        if by_itself or self._halted or (mode, zero) != self._seen:
            self.judge.own_ramp()
        elif mode in OWN_PROFILES:
            speed = self.axis._speed * self.axis.scale / self._counts_per_rad
            self.judge.profile(self.now, speed)
        self._seen = mode, zero
        self.judge.power(self.now, self.power in ENERGISED)

    def tick(self, now: float) -> None:
        super().tick(now)
        self.take_stock()

    def measurements(self) -> dict[str, Any]:
        return super().measurements() | {"findings": self.judge.findings}
