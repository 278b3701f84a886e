"""Target of the checks: one backend and one robot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from robotd.api import Capability, ProfiledAxes, RobotdError
from robotd.api.commands import load_robot
from robotd.api.models import RobotDescriptor, parse_override
from robotd.api.robots import load_backend
from robotd_conformance.checks.harness import Harness
from robotd_conformance.checks.inconclusive import STALL_S
from robotd_conformance.checks.interruption import INTERRUPTION
from robotd_conformance.checks.start_pose import StartPose

PLAIN_ROBOT = Path(__file__).parent / "plain.yaml"


class KitTarget:
    """Builds rigs. Raises RobotdError when backend or robot cannot be loaded.

    Args:
        robot: name or file; None is the plain robot.
        overrides: ``KEY=VALUE`` texts that replace values of its file.
        pose: start pose of the run; None: one with the default bounds.

    Attributes:
        uses_context_clock: the device is simulated and has no time but the clock that it is given.
        feedback_s: time between two measured values.
        read_only: the axes take no commands.
        real_time: the running check has a harness in real time.
        stall_s: length of a stall that may make a check fail.
        arguments: the three above as texts, "" for no robot; the overrides follow one by one.
    """

    def __init__(
        self,
        backend: str,
        robot: str | None,
        overrides: Sequence[str] = (),
        pose: StartPose | None = None,
    ) -> None:
        self.arguments = (backend, str(robot or ""), *overrides)
        self.backend = load_backend(backend)
        self.descriptor = _find(robot or PLAIN_ROBOT, overrides)
        drivers = self.backend.drivers(self.backend.context(self.descriptor))
        injector = drivers.make_fault_injector()
        simulated = Capability.SIMULATED in self.backend.capabilities
        self.uses_context_clock = simulated and bool(injector and injector.uses_context_clock)
        period_s = 1.0 / self.descriptor.cycle.rate_hz
        self.feedback_s = max(period_s, drivers.axes.feedback_period_s)
        self.read_only = bool(drivers.axes.read_only)
        self.stall_s = STALL_S
        if isinstance(getattr(drivers.axes, "wrapped", drivers.axes), ProfiledAxes):
            # Such axes come to rest where the control loop is late by a period.
            self.stall_s = min(STALL_S, period_s)
        self.pose = pose or StartPose()
        self._shared: Harness | None = None
        self._built: list[Harness] = []
        self._checked: list[Harness] = []  # those of the running check, the shared one included
        self.begin()

    def build(self, **options: Any) -> Harness:
        """Return a harness that is not started."""
        clocked = self.uses_context_clock
        harness = Harness(
            self.backend, self.descriptor, self.pose, uses_context_clock=clocked, **options
        )
        self.real_time |= not harness.stepped
        self._built.append(harness)
        self._checked.append(harness)
        self._began_ns[id(harness)] = harness.clock.now_ns()
        return harness

    @property
    def stray(self) -> str:
        """Axis that is outside of its range, or of hardware too far from its start pose; ""."""
        simulated = Capability.SIMULATED in self.backend.capabilities
        began = self.pose.position is not None
        return "" if simulated and began else self.pose.exceeded

    @property
    def passed_s(self) -> float:
        """Time that has passed in the newest harness of the running check, s."""
        if not self._checked:
            return 0.0
        newest = self._checked[-1]
        return (newest.clock.now_ns() - self._began_ns.get(id(newest), 0)) * 1e-9

    @property
    def refused(self) -> str:
        """Command that the running check was refused, or why no check can begin; "" for none."""
        first = next((driver.guard.refused for driver in self._checked if driver.guard.refused), "")
        return self.pose.misplaced or first

    def take_wrong_calls(self) -> list[str]:
        """Return the wrong calls of drivers since the last time, see ``Harness``."""
        calls = [call for harness in self._built for call in harness.wrong_calls]
        self._built = [self._shared] if self._shared else []
        for harness in self._built:
            harness.wrong_calls.clear()
        return calls

    def shared(self) -> Harness:
        """Return the shared harness, replaced when the last check broke it."""
        harness = self._shared
        if harness is not None:
            harness.undo_faults()
            harness.periods(2)
            if not harness.healthy:
                self.clear()
        if self._shared is None:
            harness = self.build()
            self._shared = harness
            harness.start()
        self._shared.return_to_start()
        return self._shared

    def return_to_start(self) -> str:
        """Move the axes back to the start pose; return why that failed, or "".

        After a check, whatever it has left. A simulation is not opened for it.
        """
        pose, simulated = self.pose, Capability.SIMULATED in self.backend.capabilities
        if pose.position is None or self.read_only:
            return ""
        is_there = pose.left is not None and pose.is_start(pose.left)
        if self._shared is None and (simulated or is_there):
            return ""
        try:
            self.shared()
        except (AssertionError, RobotdError) as error:
            self.clear()
            return "" if simulated else f"the axes are not back at their start pose: {error}"
        return ""

    def begin(self, item: pytest.Item | None = None) -> None:
        """Begin a check, which may build a harness in real time."""
        self.real_time = not self.uses_context_clock
        self._checked = [self._shared] if self._shared else []
        self._began_ns = {id(driver): driver.clock.now_ns() for driver in self._checked}

    def clear(self, item: pytest.Item | None = None) -> None:
        """Shut the shared harness down."""
        with INTERRUPTION.during_shutdown():
            harness, self._shared = self._shared, None
            if harness is not None:
                harness.stop()


def _find(robot: str | Path, overrides: Sequence[str]) -> RobotDescriptor:
    """Load a robot of robotd, of a plugin or a file, without its joint groups."""
    changes = [parse_override(text) for text in overrides]
    descriptor = load_robot(str(robot), overrides=changes)
    return descriptor.model_copy(update={"groups": {}})
