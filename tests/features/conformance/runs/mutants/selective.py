"""Faults of a driver at its last axis, in one direction, or in repeated calls only."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

from robotd.api import ProcessImage
from robotd_sim import SimAxes, SimFieldbus

Kind = TypeVar("Kind", bound=type)
Call = Callable[..., Any]


def last_axis(kind: Kind) -> Kind:
    """Return axes, or a fieldbus, that have the fault of ``kind`` at the last axis or node."""
    return _changed(kind, _of_the_last)


def repeated(kind: Kind) -> Kind:
    """Return drivers that have the fault of ``kind`` from the second equal call on."""
    return _changed(kind, _from_the_second)


def _changed(kind: Kind, change: Callable[[Call, Call], Call]) -> Kind:
    sound = kind.__mro__[1]
    methods = {
        name: change(member, getattr(sound, name))
        for name, member in vars(kind).items()
        if callable(member) and hasattr(sound, name) and not name.startswith("_")
    }
    return type(kind)(kind.__name__, (kind,), methods)  # type: ignore[no-any-return]


def _of_the_last(faulty: Call, sound: Call) -> Call:
    names = list(inspect.signature(sound).parameters)
    if names[1] == "image":
        return _read_of_the_last(faulty, sound)
    place = next(names.index(name) for name in ("axis", "axes", "node") if name in names) - 1

    def call(self: Any, *given: Any, **named: Any) -> Any:
        chosen = given[place]
        if isinstance(self, SimFieldbus):
            is_last = chosen == max(self.node_ids(0))
            return (faulty if is_last else sound)(self, *given, **named)
        last = self._simulation.axes - 1
        if isinstance(chosen, Sequence):
            for axes, method in (([a for a in chosen if a != last], sound), ([last], faulty)):
                if set(axes) & set(chosen):
                    method(self, axes, *given[1:], **named)
            return None
        return (faulty if chosen == last else sound)(self, *given, **named)

    return call


def _read_of_the_last(faulty: Call, sound: Call) -> Call:
    def read(self: Any, image: ProcessImage) -> None:
        twin = vars(self).setdefault("twin", ProcessImage(self._simulation.axes))
        faulty(self, twin)
        self._readout._image = None  # the two images are filled in turn
        sound(self, image)
        for block in ("values", "flags", "numbers"):
            getattr(image, block)[:, -1] = getattr(twin, block)[:, -1]
        image.reason[-1] = twin.reason[-1]
        self._readout._image = None

    return read


def _from_the_second(faulty: Call, sound: Call) -> Call:
    def call(self: Any, *given: Any, **named: Any) -> Any:
        plain = [tuple(value) if isinstance(value, Sequence) else value for value in given]
        key = (
            sound.__name__,
            *(v for v in plain if isinstance(v, bool | int | tuple | np.integer)),
        )
        calls = vars(self).setdefault("calls_made", set())
        method = faulty if key in calls else sound
        calls.add(key)
        return method(self, *given, **named)

    return call


def backwards(kind: Kind) -> Kind:
    """Return axes that have the fault of ``kind`` where they move in negative direction."""
    return _changed(kind, _of_those_that_move_backwards)


def move_backwards(axes: SimAxes) -> list[int]:
    """Return the axes that move in negative direction at present."""
    simulation = axes._simulation
    with simulation.world.lock:
        simulation.world.advance()
        return [a for a in range(simulation.axes) if simulation.servo.velocity(a) < 0.0]


def _of_those_that_move_backwards(faulty: Call, sound: Call) -> Call:
    def call(self: SimAxes, chosen: int | Sequence[int], *given: Any, **named: Any) -> None:
        back = move_backwards(self)
        if not isinstance(chosen, Sequence):
            (faulty if chosen in back else sound)(self, chosen, *given, **named)
            return
        for method, axes in (
            (sound, [axis for axis in chosen if axis not in back]),
            (faulty, [axis for axis in chosen if axis in back]),
        ):
            if axes:
                method(self, axes, *given, **named)

    return call
