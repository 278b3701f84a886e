"""Owners of axes: who may stream setpoints to them."""

from __future__ import annotations

from collections.abc import Sequence

from robotd.device.command_effect import CommandEffect
from robotd.device.drivers import AxisDriver
from robotd.device.process_image import ProcessImage
from robotd.device.state import Operation
from robotd.errors import RobotdError
from robotd.log import get_logger

log = get_logger("axes")


class AxisClaims:
    """Axes that are reserved for an owner, and their streaming in the device.

    ``owner`` for any thread; the rest for one worker at a time.

    Args:
        driver: begins and ends streaming.
        image: the live process image.
        effect: waits until the image shows the end of streaming.
    """

    def __init__(self, driver: AxisDriver, image: ProcessImage, effect: CommandEffect) -> None:
        self._driver, self._image, self._effect = driver, image, effect
        self._owners: dict[int, str] = {}

    def owner(self, axis: int) -> str:
        """Return the owner of ``axis``, "" if it has none."""
        return self._owners.get(axis, "")

    def take(self, owner: str, axes: Sequence[int], *, streams: bool) -> None:
        """Reserve ``axes``, which are idle; ``streams``: they get setpoints from now on."""
        if streams:
            self._driver.begin_stream(axes)
        self._owners.update(dict.fromkeys(axes, owner))

    def hand_over(self, axes: Sequence[int], owner: str) -> None:
        """Change the owner of ``axes``, which are taken."""
        self._owners.update(dict.fromkeys(axes, owner))

    def give_back(self, axes: Sequence[int], *, streams: bool) -> None:
        """Undo ``take``; a device that is gone is logged, not an error."""
        for axis in axes:
            self._owners.pop(axis, None)
        if not streams:
            return
        try:
            self._driver.end_stream(axes)
        except RobotdError as error:
            log.warning("a stream could not be ended", reason=str(error))
        self._effect.wait_for(lambda: not self._ending(axes))

    def _ending(self, axes: Sequence[int]) -> bool:
        """The image still shows streaming, or the stop that ends it on some devices."""
        ending = (Operation.STREAM, Operation.STOPPING)
        return any(self._image.operation[axis] in ending for axis in axes)
