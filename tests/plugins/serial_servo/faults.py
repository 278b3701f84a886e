"""Faults of a serial line: probabilities with a seed, or a number of times for certain."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from random import Random


@dataclass(slots=True)
class Faults:
    """Faults of replies; each field but the last three is a probability per reply, 0 … 1.

    ``force("drop", 2)`` lets a fault happen to the next two replies.
    """

    lose_request: float = 0.0
    """The request does not arrive: it is neither executed nor answered. Per servo."""
    drop: float = 0.0
    """The request is executed, the reply is lost."""
    corrupt: float = 0.0
    """One bit of the reply is flipped, anywhere."""
    wrong_checksum: float = 0.0
    truncate: float = 0.0
    """The reply ends early, with 1 to n - 1 bytes."""
    wrong_id: float = 0.0
    """The reply has the id of another servo and a right checksum."""
    falsify: float = 0.0
    """One bit of the data is flipped and the checksum is right."""
    noise: float = 0.0
    """One to four random bytes come before the reply."""
    split: float = 0.0
    """The reply arrives in two parts, ``split_s`` apart."""
    delay: float = 0.0
    """The reply begins ``delay_s`` late."""
    split_s: float = 0.003
    delay_s: float = 0.1
    forced: dict[str, int] = field(default_factory=dict)

    def force(self, name: str, times: int = 1) -> None:
        """Let the fault happen to the next ``times`` replies."""
        if name not in PROBABILITIES:
            raise AttributeError(f"no fault {name} (available: {', '.join(PROBABILITIES)})")
        self.forced[name] = self.forced.get(name, 0) + times

    def happens(self, name: str, random: Random) -> bool:
        if self.forced.get(name, 0) > 0:
            self.forced[name] -= 1
            return True
        probability: float = getattr(self, name)
        return probability > 0 and random.random() < probability


PROBABILITIES = tuple(
    item.name for item in fields(Faults) if item.name not in {"split_s", "delay_s", "forced"}
)


def flip_a_bit(data: bytes, random: Random, first: int = 0) -> bytes:
    """Return ``data`` with one bit flipped, in a byte from ``first`` on."""
    flipped = bytearray(data)
    flipped[random.randrange(first, len(data))] ^= 1 << random.randrange(8)
    return bytes(flipped)


def collide(frames: list[bytes], random: Random) -> bytes:
    """Return what a UART receives when several servos reply at once on one wire.

    A 0 bit wins over a 1 bit. The servos begin up to nine bit times apart, so that the bytes rarely
    agree. A byte with a framing error is received as 0.
    """
    if len(frames) == 1:
        return frames[0]
    late = [0] + [random.randrange(1, 10) for _ in frames[1:]]
    bits = [1] * (max(map(len, frames)) * 10 + 20)
    for frame, start in zip(frames, late, strict=True):
        for index, byte in enumerate(frame):
            for place, bit in enumerate([0, *(byte >> shift & 1 for shift in range(8)), 1]):
                bits[start + index * 10 + place] &= bit
    received = bytearray()
    place = 0
    while place <= len(bits) - 10:
        if bits[place]:
            place += 1
            continue
        byte = sum(bits[place + 1 + shift] << shift for shift in range(8))
        received.append(byte if bits[place + 9] else 0)
        place += 10
    return bytes(received)
