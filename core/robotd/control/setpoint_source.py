"""Bases of everything that moves axes by setpoints: trajectories, streams, jogs, the base."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np

from robotd.arrays import FloatArray, IntArray
from robotd.control.completion import Completion
from robotd.control.execution_phase import PhaseState
from robotd.control.fault_monitor import FaultMonitor
from robotd.control.stall_recovery import StallRecovery
from robotd.device.process_image import ProcessImage, columns
from robotd.motion import MotionState

REST_TIMEOUT_S = 2.0  # after that a joint that still moves is reported, not waited for


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

    stall_recovery: StallRecovery | None = None

    def __init__(self, axes: Sequence[int] | IntArray, start_ns: int, setpoint: FloatArray) -> None:
        self.columns = columns(axes)
        self.start_ns, self.setpoint = start_ns, setpoint
        self.completion = Completion()

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


class JointSource(SetpointSource):
    """Source that moves joints: it watches their drives, and ends when they are at rest.

    Args:
        names: of the joints.
        axes, start_ns, setpoint: as of ``SetpointSource``.
        stopped_velocity: (m,) rad/s or m/s below which a joint is at rest.
        streamed: the axes have to stay in streaming once they were in it.
    """

    def __init__(
        self,
        names: tuple[str, ...],
        axes: IntArray,
        start_ns: int,
        setpoint: FloatArray,
        stopped_velocity: FloatArray,
        *,
        streamed: bool = True,
    ) -> None:
        super().__init__(axes, start_ns, setpoint)
        self._axes, self._stopped_velocity = axes, stopped_velocity
        self._monitor = FaultMonitor(names, axes, streamed=streamed)
        self._phase = PhaseState(start_ns)
        self._advanced_ns = start_ns

    def _continue(self, running: SetpointSource, advanced_ns: int, delay_ns: int) -> None:
        """Take over setpoint and time of ``running``; the arguments are those of ``take_over``."""
        self.setpoint[:] = running.setpoint
        self._advanced_ns = advanced_ns
        self.start_ns += delay_ns

    def _begin_period(self, time_ns: int) -> int:
        """Return the time since the period before, in ns."""
        pause_ns, self._advanced_ns = time_ns - self._advanced_ns, time_ns
        return pause_ns

    def _check_drives(self, image: ProcessImage, time_s: float, pause_ns: int) -> None:
        """End with a fault when a drive does not follow, also during a stop.

        Args:
            image: of the present period.
            time_s: for the text: since the start, or of the trajectory.
            pause_ns: since the period before.
        """
        if self._monitor.is_faulty(image) and not self.completion.is_fault:
            self.completion.escalate(self._monitor.describe(image, time_s, pause_ns))

    def _moves(self, image: ProcessImage) -> bool:
        """Return True while a joint moves."""
        fast = np.abs(image.velocity[self.columns]) > self._stopped_velocity
        # The velocity of an offline drive is an old value.
        return bool((fast & ~image.offline[self.columns]).any())

    def _is_settled(self, time_ns: int, *, at_rest: bool) -> bool:
        """Count a period; return True when the joints are at rest, or were waited for."""
        return self._phase.settle(at_rest) or self._phase.age_s(time_ns) > REST_TIMEOUT_S

    def _finish(self, *, moving: bool) -> None:
        """End as requested; no effect without a request."""
        if self.completion.requested is not None:
            outcome, message = self.completion.requested
            self.completion.finish(outcome, f"{message}; joints still move" if moving else message)

    def _end_at_rest(self, time_ns: int, image: ProcessImage) -> None:
        """End as requested when the joints are at rest, or were waited for."""
        moving = self._moves(image)
        if self._is_settled(time_ns, at_rest=not moving):
            self._finish(moving=moving)
