"""Reduced speed: switch, input and supervision of a limit of the speed of arms.

No safety function.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping

import numpy as np

from robotd.clock import NANOSECONDS
from robotd.control.groups.joint_group import JointGroup
from robotd.control.loop.control_loop import ControlLoop
from robotd.descriptor.reduced_speed_settings import ReducedSpeedSettings
from robotd.device.axes import Axes
from robotd.device.io import Io
from robotd.device.motion_limits import Factors
from robotd.device.process_image import ProcessImage
from robotd.errors import DescriptorError, Unsupported, unknown_name
from robotd.events import EventKind
from robotd.log import get_logger

log = get_logger("speed")

STOP_SHARE = 1.1  # share of the limit from which a move or jog that runs in the device is stopped


class ReducedSpeed:
    """Switch that limits the speed of the arms of a robot. Any worker thread.

    It is on by command, or by the input of the robot's file. Of which points the speed is, and how
    it follows from the joints, is what a feature knows: see ``factors``.

    Args:
        groups, axes, io, control_loop: of the robot.
        settings: from the robot's file.
        factors: returns what ``MotionLimits.set_speed`` takes, for a group with joints and a
            limit, m/s; raises DescriptorError, Unsupported where the group cannot be limited.

    Raises:
        DescriptorError: no input has the name of ``settings``.
        Unsupported, DescriptorError: there is an input, and a group cannot be limited, or the
            device interpolates trajectories itself.
    """

    def __init__(
        self,
        groups: Mapping[str, JointGroup],
        axes: Axes,
        io: Io,
        control_loop: ControlLoop,
        settings: ReducedSpeedSettings,
        factors: Callable[[JointGroup, float], Factors],
    ) -> None:
        self._axes, self._control_loop, self._settings = axes, control_loop, settings
        self._groups = [group for group in groups.values() if group.joint_names]
        self._factors_of = factors
        self._factors: list[Factors] = []  # of ``_groups``, made when they are needed first
        self._commanded = self._by_input = self._is_on = False
        self._unreadable = self._logged = ""  # reason why the input cannot be read
        self._listeners: list[Callable[[bool], None]] = []
        self._lock = threading.Lock()
        self._reads_input: Callable[[], bool] | None = None
        self._watches = False
        if (name := settings.reduced_speed_input) is not None:
            self._require_possible()
            address = io.inputs.get(name)
            if address is None:
                text = unknown_name("input", name, io.inputs)
                raise DescriptorError(text)
            self._reads_input = io.input_watcher(*address)
            self._by_input = True  # until it has been read
            self._apply()
            self._watch()

    @property
    def is_on(self) -> bool:
        """The limit is in force."""
        return self._is_on

    @property
    def text(self) -> str:
        """State in words."""
        if not self._is_on:
            return "reduced speed is off"
        limit = f"{self._settings.reduced_speed_m_s:g} m/s"
        text = f"reduced speed: links and tool move with at most {limit}"
        return f"{text}; {self._unreadable}" if self._unreadable else text

    def set(self, on: bool) -> None:
        """Switch it on or off by command; the input may keep it on.

        Motion slows down within the limits of the joints; moves and jogs of single axes that are
        faster are stopped, torque streams end.

        Raises Unsupported, DescriptorError: it cannot be on; see the class.
        """
        if on:
            self._require_possible()
        with self._lock:
            self._commanded = on
            self._apply()
            if on:
                self._watch()

    def on_change(self, listener: Callable[[bool], None]) -> None:
        """Call ``listener(on)`` now and on every change, from the thread that causes it."""
        with self._lock:
            self._listeners.append(listener)
            listener(self._is_on)

    def _watch(self) -> None:
        """Look in each period from now on; a robot that never needs it pays nothing."""
        if not self._watches:
            self._watches = True
            rate_hz = NANOSECONDS / self._control_loop.period_ns
            self._control_loop.every(rate_hz, "reduced speed", self._look)

    def _require_possible(self) -> None:
        if self._axes.trajectories_on_device:
            raise Unsupported("reduced speed", self._axes.backend)
        if not self._factors:
            limit_m_s = self._settings.reduced_speed_m_s
            self._factors = [self._factors_of(group, limit_m_s) for group in self._groups]

    def _apply(self) -> None:
        """Set or clear the limits. Lock held."""
        before, self._is_on = self._is_on, self._commanded or self._by_input
        unreadable, self._logged = self._logged, self._unreadable
        remedy = "For full speed: robotd tool reduced off"
        if self._by_input:
            remedy = f"The input {self._settings.reduced_speed_input} switches it on"
        if self._unreadable:
            remedy = "Check the I/O module: as long as the input is unknown the speed is reduced"
        for group, factors in zip(self._groups, self._factors, strict=False):  # none before use
            if self._is_on:
                group.motion_limits.set_speed(factors, self.text, remedy)
            else:
                group.motion_limits.clear_speed()
        if self._unreadable and not unreadable:
            log.error("the input of reduced speed cannot be read", reason=self._unreadable)
        if self._is_on != before:
            log.info(self.text)
            self._axes.events.add(EventKind.STATE, "speed", self.text)
            for listener in self._listeners:
                listener(self._is_on)

    def _look(self, image: ProcessImage) -> None:
        """Follow the input, and stop moves and jogs that are too fast. Control loop."""
        if self._reads_input is not None:
            self._follow(self._reads_input)
        if self._is_on:
            for group in self._groups:
                self._stop_too_fast(group, image)

    def _follow(self, read: Callable[[], bool]) -> None:
        """Switch it on or off as the input says; one that cannot be read switches it on."""
        try:
            by_input, unreadable = read() == bool(self._settings.reduced_speed_level), ""
        except Exception as error:  # noqa: BLE001 - of a plugin; unknown means reduced
            name = self._settings.reduced_speed_input
            by_input, unreadable = True, f"input {name} cannot be read ({error})"
        seen = self._by_input, self._unreadable
        if (by_input, unreadable) != seen and self._lock.acquire(blocking=False):
            try:
                self._by_input, self._unreadable = by_input, unreadable
                self._apply()
            finally:
                self._lock.release()

    def _stop_too_fast(self, group: JointGroup, image: ProcessImage) -> None:
        moved, factors = group.moved_by_device(image), group.motion_limits.factors
        if moved and factors is not None:
            axes = list(group.joint_axes)
            velocity = np.where(np.isin(axes, moved), image.velocity[axes], 0.0)
            if float(factors(image.position[axes][None], velocity[None])[0]) < 1.0 / STOP_SHARE:
                self._axes.stops.request(moved)
