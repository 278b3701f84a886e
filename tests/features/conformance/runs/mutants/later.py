"""Faults that a driver has from the second connection on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import ConnectionState
from robotd_sim import SimDevice

Kind = TypeVar("Kind", bound=type)


class CountingDevice(SimDevice):
    """Counts its connections, for ``later``."""

    def open(self, path: str = "", name: str = "") -> None:
        if self.state() is ConnectionState.IDLE:
            counted = vars(self.simulation)
            counted["connections"] = counted.get("connections", 0) + 1
        super().open(path, name)


def later(kind: Kind) -> Kind:
    """Return drivers that have the fault of ``kind`` in later connections of a counting device."""
    sound = kind.__mro__[1]

    def in_turn(faulty: Callable[..., Any], name: str) -> Callable[..., Any]:
        def call(self: Any, *given: Any, **named: Any) -> Any:
            simulation = getattr(self, "_simulation", None) or self.simulation
            is_later = vars(simulation).get("connections", 0) > 1
            return (faulty if is_later else getattr(sound, name))(self, *given, **named)

        return call

    methods = {
        name: in_turn(member, name)
        for name, member in vars(kind).items()
        if callable(member) and hasattr(sound, name) and name not in {"__init__", "__doc__"}
    }
    bases = (CountingDevice, kind) if issubclass(kind, SimDevice) else (kind,)
    return type(kind)(kind.__name__, bases, methods)  # type: ignore[no-any-return]


class LaterMutant(Mutant):
    """A mutant whose other drivers are made by ``later``."""

    Device = CountingDevice
