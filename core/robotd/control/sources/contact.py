"""Contact: a motion ends when the torque of a joint shows that it touches something."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from robotd.arrays import FloatArray, IntArray
from robotd.device.process_image import ProcessImage
from robotd.errors import NotReady
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

    def require_torques(self, limits: JointLimits, torque: FloatArray) -> None:
        """Raise NotReady where a torque (m,) that counts is not reported."""
        unknown = np.isfinite(self.torque) & ~np.isfinite(torque)
        names = [name for name, lacks in zip(limits.names, unknown, strict=True) if lacks]
        if names:
            text = f"no torque of {', '.join(names)} is reported"
            raise NotReady(f"{text}: motion until a contact needs it")


class Contact(NamedTuple):
    """Contact that has ended a motion.

    Attributes:
        joint: its name.
        change: of its torque since the motion began, N·m or N.
        positions: (m,) measured when it was noticed, rad or m.
    """

    joint: str
    change: float
    positions: FloatArray


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
        self.contact = Contact(name, float(change[joint]), image.position[columns].copy())
        return f"contact: the torque of {self._text(joint, change)}"

    @property
    def most(self) -> str:
        """Text about the largest change so far, of the joint nearest to its limit."""
        return self._text(int(np.argmax(self._largest / self._wanted)), self._largest)

    def _text(self, joint: int, change: FloatArray) -> str:
        unit = UNITS[self._limits.units[joint]]
        name, limit = self._limits.names[joint], self._wanted[joint]
        return f"{name} has changed by {change[joint]:.2f} {unit}, limit {limit:g} {unit}"
