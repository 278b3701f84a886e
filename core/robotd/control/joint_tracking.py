"""Following error of the joints of an execution, and its published progress."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robotd.arrays import FloatArray


@dataclass(frozen=True)
class Progress:
    """Progress of an execution; arrays (m,) in the order of the trajectory's names."""

    time_s: float
    desired_position: FloatArray
    desired_velocity: FloatArray
    actual_position: FloatArray
    actual_velocity: FloatArray


class JointTracking:
    """Desired and measured motion of m joints in the present period.

    ``progress`` may be called by any thread, the rest belongs to the control loop.

    Args:
        setpoint: (2, m) position and velocity at the start.

    Attributes:
        desired, measured: (2, m) position and velocity of the present period.
    """

    def __init__(self, setpoint: FloatArray) -> None:
        self._motion: FloatArray = np.stack([setpoint, setpoint])
        self.desired, self.measured = self._motion
        self._max_error = [0.0] * setpoint.shape[1]
        # Replaced as a whole: another thread sees the values of one period.
        self._snapshot = (0.0, self._motion.copy())

    @property
    def max_error(self) -> FloatArray:
        """(m,) largest following error so far, rad or m."""
        return np.array(self._max_error)

    def update(self, measured: FloatArray, time_s: float) -> None:
        """Take the ``measured`` (2, m) of a period, whose ``desired`` is written already.

        The errors in plain floats: NumPy would take three functions that run nowhere else in a
        period.
        """
        self.measured[:] = measured
        worst, position = self._max_error, self.measured[0].tolist()
        for joint, wanted in enumerate(self.desired[0].tolist()):
            # NaN leaves the maximum as it is.
            worst[joint] = max(worst[joint], abs(wanted - position[joint]))
        self._snapshot = time_s, self._motion.copy()

    def progress(self) -> Progress:
        """Return the values of one control period: path at ``time_s`` and measurement."""
        time_s, (desired, measured) = self._snapshot
        return Progress(time_s, desired[0], desired[1], measured[0], measured[1])
