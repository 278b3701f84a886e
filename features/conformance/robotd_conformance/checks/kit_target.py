"""Target of the checks: one backend and one robot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from robotd.api import Capability, RobotdError
from robotd.api.commands import load_robot
from robotd.api.models import RobotDescriptor, parse_override
from robotd.api.robots import Backend, load_backend
from robotd_conformance.checks.harness import Harness
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
        real_time: the running check has a harness in real time.
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
        self.uses_context_clock = _uses_context_clock(self.backend, self.descriptor)
        self.pose = pose or StartPose()
        self.begin()
        self._shared: Harness | None = None
        self._built: list[Harness] = []

    def build(self, **options: Any) -> Harness:
        """Return a harness that is not started."""
        clocked = self.uses_context_clock
        harness = Harness(
            self.backend, self.descriptor, self.pose, uses_context_clock=clocked, **options
        )
        self.real_time |= not harness.stepped
        self._built.append(harness)
        return harness

    @property
    def stray(self) -> str:
        """Axis that is outside of its range, or of hardware too far from its start pose; ""."""
        simulated = Capability.SIMULATED in self.backend.capabilities
        began = self.pose.position is not None
        return "" if simulated and began else self.pose.exceeded

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
        if pose.position is None:
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

    def clear(self, item: pytest.Item | None = None) -> None:
        """Shut the shared harness down."""
        with INTERRUPTION.during_shutdown():
            harness, self._shared = self._shared, None
            if harness is not None:
                harness.stop()


def _uses_context_clock(backend: Backend, descriptor: RobotDescriptor) -> bool:
    """The device is simulated and has no time but the clock that it is given."""
    injector = backend.drivers(backend.context(descriptor)).make_fault_injector()
    simulated = Capability.SIMULATED in backend.capabilities
    return simulated and injector is not None and injector.uses_context_clock


def _find(robot: str | Path, overrides: Sequence[str]) -> RobotDescriptor:
    """Load a robot of robotd, of a plugin or a file, without its joint groups."""
    changes = [parse_override(text) for text in overrides]
    descriptor = load_robot(str(robot), overrides=changes)
    return descriptor.model_copy(update={"groups": {}})
