"""Objects of one drive axis in the process data and by SDO, for ``robotd_cia402``."""

from __future__ import annotations

from collections.abc import Collection

from robotd_cia402.emcy import Emergency
from robotd_cia402.object_numbers import (
    AXIS_STEP,
    CONTROLWORD,
    INTERPOLATION,
    MODE,
    PROFILE_AREA,
    TARGET_POSITION,
    TARGET_TORQUE,
    TARGET_VELOCITY,
    on_axis,
)
from robotd_ethercat.exchange import Exchange
from robotd_ethercat.slave import Slave

_SET_BY_AXIS = (
    CONTROLWORD, MODE, TARGET_POSITION, TARGET_VELOCITY, TARGET_TORQUE, INTERPOLATION,
)  # fmt: skip


class SlaveObjects:
    """Implements ``robotd_cia402.CyclicObjects`` for one axis of a slave.

    Mapped outputs that no part of robotd sets, such as a torque limit, keep the value that the
    drive had when it was configured.
    """

    def __init__(self, slave: Slave, axis_offset: int, exchange: Exchange) -> None:
        self._slave, self._offset, self._exchange = slave, axis_offset, exchange
        self._image = slave.image
        self._output_slots: dict[int, int] = {}
        self._input_slots: dict[int, int] = {}
        self._forgotten_at = 0

    @property
    def name(self) -> str:
        return f"slave {self._slave.number}"

    @property
    def online(self) -> bool:
        return self._slave.online

    @property
    def fault(self) -> str:
        return self._slave.fault

    @property
    def complete(self) -> bool:
        return self._exchange.good_frames > self._forgotten_at

    @property
    def frames(self) -> int:
        return self._exchange.frames

    @property
    def emergency(self) -> Emergency | None:
        return self._slave.emergency

    @property
    def inputs(self) -> Collection[int]:
        return self._input_slots

    @property
    def outputs(self) -> Collection[int]:
        return self._output_slots

    def put(self, index: int, value: int) -> None:
        slot = self._output_slots.get(index)
        if slot is not None:
            self._image.outputs[slot] = value

    def get(self, index: int) -> int:
        slot = self._input_slots.get(index)
        return self._image.inputs[slot] if slot is not None else 0

    def has(self, index: int) -> bool:
        return self._slave.has(on_axis(index, self._offset))

    def read(self, index: int, sub: int = 0) -> int:
        return self._slave.read(on_axis(index, self._offset), sub)

    def write(self, index: int, sub: int, value: int) -> None:
        self._slave.write(on_axis(index, self._offset), sub, value)

    def forget(self) -> None:
        self._forgotten_at = self._exchange.good_frames

    def find_slots(self) -> None:
        """Worker: take the mapping of the slave, which has been configured."""
        self._input_slots = self._slots(self._image.input_slots)
        found = self._slots(self._image.output_slots)
        self._output_slots = {index: found[index] for index in _SET_BY_AXIS if index in found}

    def _slots(self, slots: dict[tuple[int, int], int]) -> dict[int, int]:
        """Slots of this axis by the profile's number of the object."""
        first = self._offset * AXIS_STEP
        profile = range(PROFILE_AREA.start + first, PROFILE_AREA.start + first + AXIS_STEP)
        return {
            index - first: slot
            for (index, sub), slot in slots.items()
            if sub <= 1 and index in profile
        }
