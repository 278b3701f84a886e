"""Interface of the part of an execution that makes the joints move."""

from __future__ import annotations

from typing import Protocol

from robotd.arrays import FloatArray
from robotd.control.completion import Completion
from robotd.control.execution_phase import Phase
from robotd.control.setpoint_source import SetpointSource
from robotd.control.stall_recovery import StallRecovery
from robotd.device.process_image import ProcessImage
from robotd.motion import MotionState


class TrajectorySource(Protocol):
    """Motion of m joints along a trajectory: streamed by robotd, or made by the device.

    It requests the end of the execution when it cannot continue. Control-loop thread, except
    ``begin`` and ``splice_state``.

    Attributes:
        streams: the control loop sends ``setpoint``.
        start_ns: monotonic time of the trajectory's time 0.
        time_s: trajectory time of ``setpoint``.
        setpoint: (3, m) position, velocity and acceleration for the end of the period.
        completion: of the execution; the source requests its end.
        stall_recovery: of the setpoints, None where the device makes them.
        rate: ratio of trajectory time to real time.
    """

    streams: bool
    start_ns: int
    time_s: float
    setpoint: FloatArray
    completion: Completion

    @property
    def stall_recovery(self) -> StallRecovery | None:
        """Deviation of the setpoints from the path after an underrun."""

    @property
    def rate(self) -> float:
        """Ratio of trajectory time to real time."""

    def begin(self) -> None:
        """Start: the execution was submitted and will run. Worker."""

    def splice_state(self, time_ns: int) -> MotionState | None:
        """Return the state at ``time_ns`` for a successor; None: it has to wait. Any thread."""

    def take_over(self, running: SetpointSource) -> None:
        """Continue from the setpoint that the joints are reaching with ``running``."""

    def sent(self, due_ns: int) -> None:
        """Note that ``setpoint`` was handed to the device, to be reached at ``due_ns``."""

    def expect(self, time_ns: int, phase: Phase, image: ProcessImage, out: FloatArray) -> float:
        """Write the command that the device has at ``time_ns`` into ``out`` (2, m).

        Returns its trajectory time.
        """

    def move(self, time_ns: int, due_ns: int, pause_ns: int, image: ProcessImage) -> Phase | None:
        """Continue on the path, or along the stop, to ``due_ns``.

        Args:
            time_ns: of the present period.
            due_ns: of the setpoint.
            pause_ns: since the period before.
            image: of the present period.

        Returns:
            The next phase, None while it moves.
        """

    def hold(self, due_ns: int, period_ns: int) -> None:
        """Stay at the end of the path."""

    def stop(self, time_ns: int) -> Phase:
        """Begin to stop; return the phase in which that is done."""

    @property
    def on_path(self) -> bool:
        """The setpoint does not deviate from the path."""

    def is_stopping(self, time_ns: int, image: ProcessImage) -> bool:
        """Return True while the joints may still be slowing down after ``stop``."""

    def is_active(self, image: ProcessImage) -> bool:
        """Return True while the device reports motion by itself."""

    def return_command(self, time_ns: int, offset: FloatArray) -> bool:
        """Move the command by ``offset`` (m,), to joints that did not follow; False once there.

        In each period until then. The first call counts: the measured positions minus the commands
        of the device, which may differ from the setpoints.
        """
