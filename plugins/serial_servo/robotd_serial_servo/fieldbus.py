"""Diagnostics of a bus with servos."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from robotd.api import BusNode, BusState, BusStatus, FieldbusDriver
from robotd_serial_servo.device import ServoDevice
from robotd_serial_servo.exchange import Exchange
from robotd_serial_servo.servo_record import ServoRecord


class ServoFieldbus(FieldbusDriver):
    """One bus, number 0; nodes are named by the ids of the servos."""

    def __init__(self, device: ServoDevice) -> None:
        self._device = device

    @property
    def buses(self) -> int:
        return 1

    def node_ids(self, bus: int) -> Sequence[int]:
        return [servo.servo for servo in self._device.plan.servos]

    def status(self, bus: int) -> BusStatus:
        device, plan = self._device, self._device.plan
        exchange = device.exchange
        if exchange is None or exchange.failure:
            nodes = tuple(
                BusNode(servo.servo, BusState.UNKNOWN, position=axis, offline=True, axes=1)
                for axis, servo in enumerate(plan.servos)
            )
            return BusStatus(
                BusState.UNKNOWN, axes=len(plan.servos), nodes=nodes, note=device.fault()
            )
        return BusStatus(
            BusState.OPERATIONAL if device.communicating else BusState.CONFIGURABLE,
            period_s=plan.options.exchange_period_s,
            axes=len(plan.servos),
            lost_frames=exchange.bus.corrupt,
            timeouts=sum(record.lost for record in exchange.records),
            late_cycles=exchange.late,
            nodes=tuple(
                self._node(axis, record, communicates=device.communicating)
                for axis, record in enumerate(exchange.records)
            ),
            note=device.fault(),
            details=_details(exchange),
        )

    def reset_statistics(self, bus: int) -> None:
        exchange = self._device.exchange
        if exchange is not None:
            exchange.bus.corrupt = exchange.late = 0
            exchange.longest_s = 0.0
            for record in exchange.records:
                record.lost = record.replies = 0

    def _node(self, position: int, record: ServoRecord, *, communicates: bool) -> BusNode:
        identities = {identity.number: identity for identity in self._device.identities}
        found = identities.get(record.servo)
        if record.offline:
            state, fault = BusState.UNKNOWN, "does not answer: check its cable and supply"
        else:
            state = BusState.OPERATIONAL if communicates else BusState.CONFIGURABLE
            fault = ""
        return BusNode(
            record.servo,
            state,
            error_code=record.alarm,
            position=position,
            address=record.servo,
            offline=record.offline,
            product_code=found.model if found else 0,
            axes=1,
            fault=fault,
        )


def _details(exchange: Exchange) -> Mapping[str, str]:
    """Return the longest exchange, and voltage, temperature and current of each servo."""
    details = {"longest exchange (ms)": f"{1000.0 * exchange.longest_s:.1f}"}
    for record in exchange.records:
        state, name = record.state, record.plan.name
        if state is not None:
            values = f"{state.voltage_v:.1f} V, {state.temperature_c:.0f} °C"
            current = "" if math.isnan(state.current_a) else f"{state.current_a:.2f} A, "
            load = f"{current}load {100.0 * state.load:.0f} %"
            details[f"{name} (servo {record.servo})"] = f"{values}, {load}"
    return details
