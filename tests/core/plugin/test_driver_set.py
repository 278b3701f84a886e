"""What drivers implement, beside what their backend declares."""

from __future__ import annotations

from typing import cast

from robotd.api import Capability, DeviceDriver, ProfiledAxes
from robotd.plugin.driver_set import Drivers

GUIDING = frozenset({Capability.HAND_GUIDING})


class Bare(ProfiledAxes):
    """Axes that nobody guides by hand; ``begin_guiding`` is that of ``ProfiledAxes``."""

    def __init__(self) -> None: ...  # no method of it is called

    def servo(self, axes: object, on: bool, timeout_s: float) -> None: ...

    def clear_alarm(self, axis: int, timeout_s: float) -> None: ...

    def read_feedback(self, image: object) -> None: ...

    def send_targets(self, *_: object) -> None: ...


class Guided(Bare):
    def let_go(self, axes: object, timeout_s: float) -> None: ...


def drivers(axes: ProfiledAxes) -> Drivers:
    return Drivers(cast(DeviceDriver, None), axes, None, None, lambda: None)


def test_what_a_base_class_does_with_a_method_of_the_backend_needs_that_method() -> None:
    assert "hand_guiding" not in drivers(Bare()).undeclared(frozenset())
    assert "hand_guiding" in drivers(Guided()).undeclared(frozenset())


def test_a_missing_method_is_named_as_the_backend_has_to_write_it() -> None:
    assert drivers(Guided()).missing(GUIDING) == []
    assert drivers(Bare()).missing(GUIDING) == [
        "'hand_guiding' is declared, but Bare has no method let_go()"
    ]
