"""Base of everything that moves axes by setpoints: trajectories, streams, jogs, the base."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

from robotd.arrays import FloatArray, IntArray
from robotd.control.completion import Completion
from robotd.control.stall_recovery import StallRecovery
from robotd.device.process_image import ProcessImage, columns
from robotd.motion import MotionState


class SetpointSource(ABC):
    """Motion of m axes: position, velocity and acceleration for each control period.

    A worker makes it and submits it to the ``SourceSlot`` of its axes; from then on it belongs to
    the control loop. It starts at rest, or continues the motion of another source (``take_over``).
    It ends with an outcome and a reason, its ``completion``, of its own accord or because a client
    requests it. After a success its setpoint holds the axes until a successor comes or the slot is
    released. Control-loop thread, except ``splice_state`` and ``completion``.

    By default it starts at rest, and nothing continues it.

    Args:
        axes: (m,) index of its axes among those of the device.
        start_ns: due time of its first setpoint, at the earliest.
        setpoint: (3, m) at the start.

    Attributes:
        columns: ``axes`` as an index.
        start_ns: as above.
        setpoint: (3, m) position, velocity and acceleration for the end of the period, in rad or m
            and s; position NaN for axes in velocity mode.
        completion: requested end, outcome, and the event to wait for.
        stall_recovery: deviation from its path after an underrun, which a successor continues;
            None: it keeps none.
    """

    def __init__(self, axes: Sequence[int] | IntArray, start_ns: int, setpoint: FloatArray) -> None:
        self.columns = columns(axes)
        self.start_ns, self.setpoint = start_ns, setpoint
        self.completion = Completion()
        self.stall_recovery: StallRecovery | None = None

    @property
    def rate(self) -> float:
        """Ratio of its own time to real time."""
        return 1.0

    def splice_state(self, time_ns: int) -> MotionState | None:
        """Return the state at ``time_ns`` for a successor to plan from. Any thread.

        With the derivatives at a ``rate`` of 1, and for the present ``start_ns``: a source that is
        slowed down reaches the state later, by as much as its ``start_ns`` moves. None: a
        successor has to wait until it has ended.
        """
        return None

    def take_over(  # noqa: B027 - most sources start at rest
        self, running: SetpointSource, advanced_ns: int, delay_ns: int
    ) -> None:
        """Continue from the setpoint of ``running``, made in the period ``advanced_ns``.

        ``delay_ns``: time by which ``running`` was slowed down since this source was planned;
        its start is as much later.
        """

    @abstractmethod
    def advance(self, time_ns: int, period_ns: int, image: ProcessImage) -> bool:
        """Compute the setpoint for ``time_ns + period_ns``; return False when it has none.

        Also called after its end, until it is replaced or released.
        """

    def sent(self, due_ns: int) -> None:  # noqa: B027 - not every source needs it
        """Note that ``setpoint`` was handed to the device; not called for a late one."""
