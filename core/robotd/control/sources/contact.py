"""Contact: a motion ends when torques of joints, or a wrench, show that it touches something."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf, isfinite
from typing import NamedTuple

import numpy as np

from robotd.arrays import FloatArray, IntArray
from robotd.device.process_image import ProcessImage
from robotd.device.wrench import Wrench, WrenchSensor, magnitude
from robotd.errors import InvalidArgument, NotReady
from robotd.motion import JointLimits

CONFIRMATIONS = 2  # consecutive readings beyond the limit; one may be noise
UNITS = {"rad": "N·m", "m": "N"}  # of torque, by the unit of the position


@dataclass(frozen=True, eq=False)
class ContactLimits:
    """Changes of the joints' torques, since a motion began, at which it ends.

    Attributes:
        torque: (m,) of each joint, above 0, N·m or N; inf: the joint does not count.
    """

    torque: FloatArray

    def require_ready(self, limits: JointLimits, image: ProcessImage, axes: IntArray) -> None:
        """Raise NotReady where a motion cannot begin; see ``require_torques``."""
        self.require_torques(limits, image.torque[axes])

    def watch(self, limits: JointLimits) -> ContactWatch:
        """Return what compares torques in one motion."""
        return ContactWatch(self, limits)

    def require_torques(self, limits: JointLimits, torque: FloatArray) -> None:
        """Raise NotReady where a torque (m,) that counts is not reported."""
        unknown = np.isfinite(self.torque) & ~np.isfinite(torque)
        names = [name for name, lacks in zip(limits.names, unknown, strict=True) if lacks]
        if names:
            text = f"no torque of {', '.join(names)} is reported"
            raise NotReady(f"{text}: motion until a contact needs it")


@dataclass(frozen=True, eq=False)
class WrenchAxis:
    """Axis along which a force counts, and about which a torque does.

    Attributes:
        name: for messages, with the sign, such as "-z of the tool".
        direction: of the axis, a unit vector (3,) along the axes of the sensor's link, at positions
            (m,) of the joints, rad or m. Called in the control loop.
        sign: 1, -1: values of this sign count; 0: both.
    """

    name: str
    direction: Callable[[FloatArray], FloatArray]
    sign: int = 0


@dataclass(frozen=True, eq=False)
class WrenchLimits:
    """Force and torque on a link at which a motion ends. Raises InvalidArgument.

    Attributes:
        sensor: at the link, of ``Robot.wrenches``.
        force_n, torque_nm: above 0; inf: does not count. One has to count.
        bias: the wrench at which the motion begins is subtracted, and with it the weight of the
            tool; False: the wrench is taken as the device reports it.
        axis: of the components that are compared; None: the lengths of the vectors are.
    """

    sensor: WrenchSensor
    force_n: float = inf
    torque_nm: float = inf
    bias: bool = True
    axis: WrenchAxis | None = None

    def __post_init__(self) -> None:
        for name, value in (("force_n", self.force_n), ("torque_nm", self.torque_nm)):
            if not value > 0.0:
                raise InvalidArgument(f"{name} is {value:g}, must be above 0")
        if self.force_n == self.torque_nm == inf:
            raise InvalidArgument("a contact by wrench needs force_n or torque_nm")

    def require_ready(self, limits: JointLimits, image: ProcessImage, axes: IntArray) -> None:
        """Raise NotReady: the wrench is not known, or without ``bias`` beyond a limit already."""
        wrench = self.sensor.require()
        if self.bias:
            return
        values = self.values(wrench.force, wrench.torque, image.position[axes])
        if excess := self.excess(values):
            raise NotReady(f"in contact before the motion: {excess[2]}")

    def watch(self, limits: JointLimits) -> WrenchWatch:
        """Return what compares wrenches in one motion."""
        return WrenchWatch(self)

    def values(
        self, force: FloatArray, torque: FloatArray, positions: FloatArray
    ) -> dict[str, float]:
        """Return what the limits of "force" and "torque" are for, of vectors (3,), N and N·m."""
        vectors = {"force": force, "torque": torque}
        if self.axis is None:
            return {name: magnitude(vector) for name, vector in vectors.items()}
        direction, sign = self.axis.direction(positions), self.axis.sign
        components = {name: float(direction @ vector) for name, vector in vectors.items()}
        return {name: sign * value if sign else abs(value) for name, value in components.items()}

    def excess(self, values: Mapping[str, float]) -> tuple[float, str, str] | None:
        """Return value, unit and text of a limit that is exceeded, or None."""
        for quantity, limit, unit in (
            ("force", self.force_n, "N"),
            ("torque", self.torque_nm, "N·m"),
        ):
            if not values[quantity] <= limit:
                return values[quantity], unit, self.text(quantity, values[quantity])
        return None

    def text(self, quantity: str, value: float) -> str:
        """Return a text about a "force" or "torque" and its limit."""
        unit, limit = ("N", self.force_n) if quantity == "force" else ("N·m", self.torque_nm)
        verb = "has changed by" if self.bias else "is"
        what = f"the {quantity} at {self.sensor.link}"
        if self.axis is not None:
            what += f" along {self.axis.name}"
        return f"{what} {verb} {value:.2f} {unit}, limit {limit:g} {unit}"


class Contact(NamedTuple):
    """Contact that has ended a motion.

    Attributes:
        joint: its name; "" where a wrench has shown it.
        change: of its torque since the motion began, N·m or N; of a wrench the length of the
            vector, or its component along the axis, without ``bias`` as reported.
        positions: (m,) measured when it was noticed, rad or m.
        link: where a wrench has shown it; "" for a joint.
        unit: of ``change``: N or N·m.
    """

    joint: str
    change: float
    positions: FloatArray
    link: str = ""
    unit: str = "N·m"


class ContactWatch:
    """Compares torques with those at the start of a motion. Control-loop thread.

    Attributes:
        contact: the first one; None before.
    """

    def __init__(self, contact_limits: ContactLimits, limits: JointLimits) -> None:
        self.contact: Contact | None = None
        self._wanted, self._limits = contact_limits.torque, limits
        self._begin: FloatArray | None = None  # torques
        self._largest: FloatArray = np.zeros_like(self._wanted)
        self._fresh_ns, self._beyond = 0, 0

    def look(self, image: ProcessImage, columns: slice | IntArray) -> str:
        """Take the torques of an image; return why the motion has to end, "" to go on."""
        if image.fresh_ns == self._fresh_ns:
            return ""
        self._fresh_ns, torque = image.fresh_ns, image.torque[columns]
        if self._begin is None:
            self._begin = torque.copy()
        change = torque - self._begin
        np.fmax(self._largest, np.abs(change), self._largest)
        beyond = ~(np.abs(change) <= self._wanted) & np.isfinite(self._wanted)
        self._beyond = self._beyond + 1 if beyond.any() else 0
        if self._beyond < CONFIRMATIONS:
            return ""
        joint = int(np.argmax(beyond))
        name = self._limits.names[joint]
        if not np.isfinite(change[joint]):
            return f"the torque of {name} is not known"
        unit = UNITS[self._limits.units[joint]]
        positions = image.position[columns].copy()
        self.contact = Contact(name, float(change[joint]), positions, unit=unit)
        return f"contact: the torque of {self._text(joint, change)}"

    @property
    def most(self) -> str:
        """Text about the largest change so far, of the joint nearest to its limit."""
        return self._text(int(np.argmax(self._largest / self._wanted)), self._largest)

    def _text(self, joint: int, change: FloatArray) -> str:
        unit = UNITS[self._limits.units[joint]]
        name, limit = self._limits.names[joint], self._wanted[joint]
        return f"{name} has changed by {change[joint]:.2f} {unit}, limit {limit:g} {unit}"


class WrenchWatch:
    """Compares wrenches with limits, and with that at the start of a motion. Control-loop thread.

    Attributes:
        contact: the first one; None before.
    """

    def __init__(self, limits: WrenchLimits) -> None:
        self.contact: Contact | None = None
        self._limits = limits
        self._begin: Wrench | None = None
        self._taken_ns, self._beyond = 0, 0
        self._largest = {"force": 0.0, "torque": 0.0}

    def look(self, image: ProcessImage, columns: slice | IntArray) -> str:
        """Read the wrench; return why the motion has to end, "" to go on.

        A wrench that is not known, or too old, ends it at once.
        """
        wrench = self._limits.sensor.read()
        if problem := self._limits.sensor.problem(wrench):
            return problem
        if wrench.taken_ns == self._taken_ns:
            return ""
        self._taken_ns = wrench.taken_ns
        if self._begin is None:
            self._begin = wrench
        force, torque = wrench.force, wrench.torque
        if self._limits.bias:
            force, torque = force - self._begin.force, torque - self._begin.torque
        positions = image.position[columns].copy()
        values = self._limits.values(force, torque, positions)
        if not all(map(isfinite, values.values())):
            return "the axis of the force is not known"
        for name, value in values.items():
            self._largest[name] = max(self._largest[name], value)
        excess = self._limits.excess(values)
        self._beyond = self._beyond + 1 if excess else 0
        if excess is None or self._beyond < CONFIRMATIONS:
            return ""
        value, unit, text = excess
        self.contact = Contact("", value, positions, self._limits.sensor.link, unit)
        return f"contact: {text}"

    @property
    def most(self) -> str:
        """Text about the largest values so far, of what counts."""
        counts = {"force": self._limits.force_n, "torque": self._limits.torque_nm}
        named = [name for name, limit in counts.items() if limit < inf]
        return "; ".join(self._limits.text(name, self._largest[name]) for name in named)
