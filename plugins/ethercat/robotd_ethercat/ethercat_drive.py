"""Objects of one axis on an EtherCAT line: process data, and SDO."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from operator import itemgetter

from robotd_cia402.drive_access import DriveAccess
from robotd_cia402.object_numbers import AXIS_STEP, INPUTS, OUTPUTS, PROFILE_AREA, on_axis
from robotd_ethercat.exchange import Exchange
from robotd_ethercat.slave import Slave

_UNMAPPED = -1  # slot of the 0 that follows the values of the slave


class EthercatDrive(DriveAccess):
    """One axis of ``node``; a cyclic frame is one of the process data.

    Mapped outputs that no part of robotd sets, such as a torque limit, keep the value that the
    drive had when it was configured.
    """

    node: Slave

    def __init__(self, slave: Slave, axis_offset: int, exchange: Exchange) -> None:
        super().__init__()
        self.node, self._offset, self._exchange = slave, axis_offset, exchange
        self.inputs: Collection[int] = ()
        self.outputs: Collection[int] = ()
        self._image = slave.image
        self._forgotten_at = 0
        self._pick_inputs = itemgetter(*[_UNMAPPED] * len(INPUTS))
        self._output_slots: list[tuple[int, int]] = []  # places in OUTPUTS, and in the image

    @property
    def known(self) -> bool:
        return self.node.online and self._exchange.good_frames > self._forgotten_at

    @property
    def awaited(self) -> str:
        return "no complete frame received from it yet"

    @property
    def frames(self) -> int:
        return self._exchange.frames

    @property
    def answered(self) -> int:
        return self._exchange.good_frames

    @property
    def missed(self) -> int:
        return self.node.missed

    @property
    def unreached(self) -> bool:
        return self.node.unreached

    @property
    def blocked(self) -> bool:
        return self._exchange.blocked

    def put(self, values: Sequence[int]) -> None:
        outputs = self._image.outputs
        for place, slot in self._output_slots:
            outputs[slot] = values[place]

    def values(self) -> Sequence[int]:
        found: Sequence[int] = self._pick_inputs((*self._image.inputs, 0))
        return found

    def writable(self, index: int, sub: int) -> bool:
        # Whether it is read-only shows when it is written.
        return self.node.has(on_axis(index, self._offset))

    def read(self, index: int, sub: int = 0) -> int:
        return self.node.read(on_axis(index, self._offset), sub)

    def write(self, index: int, sub: int, value: int) -> None:
        self.node.write(on_axis(index, self._offset), sub, value)

    def forget(self) -> None:
        self._forgotten_at = self._exchange.good_frames

    def find_slots(self) -> None:
        """Worker: take the mapping of the slave, which has been configured."""
        inputs = self._slots(self._image.input_slots)
        outputs = self._slots(self._image.output_slots)
        self.inputs, self.outputs = inputs.keys(), outputs.keys() & set(OUTPUTS)
        self._pick_inputs = itemgetter(*(inputs.get(index, _UNMAPPED) for index in INPUTS))
        self._output_slots = [
            (place, outputs[index]) for place, index in enumerate(OUTPUTS) if index in outputs
        ]

    def _slots(self, slots: dict[tuple[int, int], int]) -> dict[int, int]:
        """Slots of this axis by the profile's number of the object."""
        first = self._offset * AXIS_STEP
        profile = range(PROFILE_AREA.start + first, PROFILE_AREA.start + first + AXIS_STEP)
        return {
            index - first: slot
            for (index, sub), slot in slots.items()
            if sub <= 1 and index in profile
        }
