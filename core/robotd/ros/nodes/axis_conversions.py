"""Core types ↔ messages of axes and fieldbus: pure, and refusing what does not fit together."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

from robotd.device.axes import Jog, Move
from robotd.device.drivers import NetworkState
from robotd.errors import InvalidArgument
from robotd.motion.profile import Profile

# Response field of EcatGetNetworkState → attribute of NetworkState, and of SlaveInfo.
_NETWORK = {
    "master_state": "state",
    "master_mode": "mode",
    "comm_period": "comm_period_us",
    "total_axes": "total_axes",
    "total_input_size": "input_size",
    "total_output_size": "output_size",
    "ring_num": "rings",
    "total_rxpdo_size": "rx_pdo_size",
    "total_txpdo_size": "tx_pdo_size",
    "tx_delay": "tx_delay",
    "min_tx_delay": "min_tx_delay",
    "max_tx_delay": "max_tx_delay",
    "packet_loss": "packet_loss",
    "packet_timeout": "packet_timeout",
    "over_cycle": "over_cycle",
}
_SLAVE = {
    "slave_ids": "id",
    "slave_states": "state",
    "slave_al_codes": "al_code",
    "slave_positions": "position",
    "slave_addresses": "address",
    "slave_offline": "offline",
    "slave_inaccessible": "inaccessible",
    "slave_new": "new",
    "slave_reverse": "reverse",
    "slave_vendor_ids": "vendor_id",
    "slave_product_codes": "product_code",
    "slave_revision_nos": "revision",
    "slave_serial_nos": "serial",
    "slave_aliases": "alias",
    "slave_input_addrs": "input_address",
    "slave_input_sizes": "input_size",
    "slave_output_addrs": "output_address",
    "slave_output_sizes": "output_size",
    "slave_num_of_axes": "axes",
}


def axis_numbers(index: Iterable[int], count: int) -> list[int]:
    """The axes of a request: at least one, each in 0..count-1, none twice."""
    axes = list(index)
    if not axes:
        raise InvalidArgument("no axis given")
    for axis in axes:
        if not 0 <= axis < count:
            raise InvalidArgument(f"axis {axis} is outside 0..{count - 1}")
        if axes.count(axis) > 1:
            raise InvalidArgument(f"axis {axis} is given twice")
    return axes


def parallel(axes: Sequence[int], **columns: Sequence[float]) -> list[tuple[Any, ...]]:
    """One tuple of values per axis; refuses columns that are not as long as ``axes``."""
    for name, values in columns.items():
        if len(values) != len(axes):
            raise InvalidArgument(f"{name} has {len(values)} values for {len(axes)} axes")
    return list(zip(*columns.values(), strict=True))


def choices(axes: Sequence[int], data: Sequence[int], allowed: Collection[int]) -> dict[int, int]:
    """The value of ``data`` for each axis; refuses one that is not among ``allowed``."""
    values = {axis: value for axis, (value,) in zip(axes, parallel(axes, data=data), strict=True)}
    for axis, value in values.items():
        if value not in allowed:
            words = " or ".join(str(each) for each in allowed)
            raise InvalidArgument(f"axis {axis}: data {value} is not {words}")
    return values


def gear_ratios(message: Any, count: int) -> dict[int, tuple[float, float]]:
    """Axis → (numerator, denominator), both positive and finite, of a SetAxisGearRatio request."""
    axes = axis_numbers(message.index, count)
    rows = parallel(axes, numerator=message.numerator, denominator=message.denominator)
    for axis, row in zip(axes, rows, strict=True):
        for part, value in zip(("numerator", "denominator"), row, strict=True):
            if not (math.isfinite(value) and value > 0.0):
                raise InvalidArgument(
                    f"axis {axis}: gear ratio {part} {value:g} is not positive and finite"
                )
    return dict(zip(axes, rows, strict=True))


def moves(message: Any) -> list[Move]:
    """The moves of an AxisPose; their numbers are checked where they are executed."""
    rows = parallel(
        message.index,
        target=message.target,
        velocity=message.velocity,
        acc=message.acc,
        dec=message.dec,
    )
    return [
        Move(axis, target, Profile(velocity, acceleration, deceleration))
        for axis, (target, velocity, acceleration, deceleration) in zip(
            message.index, rows, strict=True
        )
    ]


def jogs(message: Any) -> list[Jog]:
    """The velocity commands of an AxisVelocity; numbers are checked where they are executed."""
    rows = parallel(message.index, velocity=message.velocity, acc=message.acc, dec=message.dec)
    return [Jog(axis, Profile(*row)) for axis, row in zip(message.index, rows, strict=True)]


def fill_outcome(
    response: Any, names: Sequence[str], results: Mapping[int, Exception | None]
) -> Any:
    """``success`` when every axis succeeded, and what happened to each in ``message``."""
    response.success = not any(results.values())
    response.message = "; ".join(
        f"{names[axis]}: {'ok' if error is None else _without_name(str(error), names[axis])}"
        for axis, error in results.items()
    )
    return response


def _without_name(text: str, name: str) -> str:
    return text.removeprefix(f"{name}: ").removeprefix(f"{name} ")


def fill_network_state(response: Any, state: NetworkState) -> Any:
    """Every field of an EcatGetNetworkState response; the slaves' arrays in parallel."""
    for field, attribute in _NETWORK.items():
        setattr(response, field, getattr(state, attribute))
    for field, attribute in _SLAVE.items():
        setattr(response, field, [getattr(slave, attribute) for slave in state.slaves])
    response.num_of_slaves = len(state.slaves)
    response.success = True
    response.message = state.note or f"{len(state.slaves)} slaves"
    return response
