"""Force and torque at links of a robot, as its device measures or estimates them."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS, Clock
from robotd.descriptor import RobotDescriptor
from robotd.descriptor.urdf import read_urdf
from robotd.device.tool_pose import tool_link
from robotd.errors import InvalidArgument, NotReady, Unsupported, unknown_name


class WrenchDriver(ABC):
    """Force and torque that act on links, such as of a sensor at the wrist. Any thread."""

    @property
    @abstractmethod
    def links(self) -> Sequence[str]:
        """Names of the links as in the URDF, in the order of ``read``. Read once, at start."""

    @abstractmethod
    def read(self, wrenches: FloatArray) -> int:
        """Fill ``wrenches`` (n, 6): force in N, then torque in N·m, that act on each link.

        Along the axes of the link, and about its origin. The weight of what the link carries may be
        part of them. NaN: not known, as while the device does not communicate. Any thread calls,
        also the control loop after ``AxisDriver.read`` of the period; must not block.

        Returns the monotonic time when they were taken, in ns, also of old values; 0 before any.
        """


class Wrench(NamedTuple):
    """Force and torque on a link, along its axes and about its origin.

    Attributes:
        force: (3,) N; NaN: not known.
        torque: (3,) N·m; NaN: not known.
        taken_ns: monotonic time; 0: never.
    """

    force: FloatArray
    torque: FloatArray
    taken_ns: int


class WrenchSensor:
    """Wrench at one link. Any thread.

    Args:
        driver: of all links.
        link: one of them.
        stale_after_s: age from which a wrench is not known.
    """

    def __init__(self, driver: WrenchDriver, link: str, clock: Clock, stale_after_s: float) -> None:
        self.link = link
        self._driver, self._clock = driver, clock
        self._row, self._count = list(driver.links).index(link), len(driver.links)
        self._stale_after_s = stale_after_s

    def read(self) -> Wrench:
        """Return the newest wrench, whatever its age. Raises what the driver raises."""
        wrenches: FloatArray = np.full((self._count, 6), np.nan)
        taken_ns = self._driver.read(wrenches)
        force, torque = wrenches[self._row].reshape(2, 3)
        return Wrench(force, torque, taken_ns)

    def problem(self, wrench: Wrench) -> str:
        """Return why a wrench cannot be relied on now; "" where it can."""
        what = f"the wrench at {self.link}"
        if not wrench.taken_ns or not np.isfinite([wrench.force, wrench.torque]).all():
            return f"{what} is not known"
        age_s = (self._clock.now_ns() - wrench.taken_ns) / NANOSECONDS
        if age_s > self._stale_after_s:
            return f"{what} is {age_s:.3f} s old, limit {self._stale_after_s:g} s"
        return ""

    def require(self) -> Wrench:
        """Return the newest wrench. Raises NotReady: it is not known, or too old."""
        wrench = self.read()
        if problem := self.problem(wrench):
            raise NotReady(problem)
        return wrench


class Wrenches(dict[str, WrenchSensor]):
    """Wrenches of a robot by link; empty where the backend has none. Any thread."""

    def __init__(
        self,
        driver: WrenchDriver | None,
        descriptor: RobotDescriptor,
        clock: Clock,
        backend: str,
    ) -> None:
        super().__init__()
        self._descriptor, self._backend = descriptor, backend
        if driver is not None:
            stale_after_s = descriptor.engine.stale_after_s
            for link in driver.links:
                self[link] = WrenchSensor(driver, link, clock, stale_after_s)

    def of(self, group: str) -> WrenchSensor:
        """Return the sensor at the tool of a joint group.

        That at its ``tool_link``, or else at the link that its last joint moves.

        Raises Unsupported: the backend has none at all, or none there; InvalidArgument: no such
        group; DescriptorError: the robot has no usable URDF.
        """
        descriptor, groups = self._descriptor, self._descriptor.joint_groups
        if not self:
            raise Unsupported("the force at a tool", self._backend)
        if group not in groups:
            raise InvalidArgument(unknown_name("joint group", group, groups))
        if descriptor.urdf is None:
            raise Unsupported(f"the force at the tool of {descriptor.name}, which has no URDF")
        urdf = read_urdf(descriptor.urdf)
        links = tool_link(urdf, descriptor, group), urdf.joint[groups[group][-1].name].child
        found = next((self[link] for link in links if link in self), None)
        if found is None:
            there = " and ".join(dict.fromkeys(links))
            known = ", ".join(self)
            raise Unsupported(f"the force at {there} (available: at {known})", self._backend)
        return found


def magnitude(vector: FloatArray) -> float:
    """Return the length of a vector (3,)."""
    x, y, z = vector.tolist()
    return math.sqrt(x * x + y * y + z * z)
