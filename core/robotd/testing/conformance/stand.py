"""What the checks run on: one backend, one robot, and at most one rig at a time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import numpy as np
import pytest

from robotd.descriptor import RobotDescriptor, default_search_path, load_robot_descriptor
from robotd.device.bench import Bench
from robotd.errors import Unsupported
from robotd.plugin.manager import load_backend, load_plugins, register_all
from robotd.testing.conformance.rig import SETTLED_RAD, Rig

PLAIN_ROBOT = {
    "schema": 1,
    "name": "plain",
    "axes": 3,
    "joints": [
        {
            "name": f"joint{axis + 1}",
            "axis": axis,
            "lower_rad": -3.0,
            "upper_rad": 3.0,
            "velocity_rad_s": 3.0,
            "acceleration_rad_s2": 10.0,
        }
        for axis in range(2)
    ],
}
"""The robot of the checks when none is named: two joints, and an axis that is none."""


class Stand:
    """Builds rigs. Raises RobotdError when backend or robot cannot be loaded.

    Args:
        robot: name or file; None is the plain robot.
    """

    def __init__(self, backend: str, robot: str | None) -> None:
        self.backend = load_backend(backend)
        self.descriptor = _find(robot) if robot else RobotDescriptor.model_validate(PLAIN_ROBOT)
        self.backend.options(self.descriptor)
        self._shared: Rig | None = None

    def build(self, **options: Any) -> Rig:
        """A rig, not brought up."""
        return Rig(self.backend, self.descriptor, **options)

    def shared(self) -> Rig:
        """The shared rig, ready for a check; a new one where the last check broke it."""
        rig = self._shared
        if rig is not None and not rig.healthy:
            self.clear()
        if self._shared is None:
            rig = self.build()
            self._shared = rig
            rig.up()
            self._pose = rig.image.position_command.copy()
        rig = self._shared
        if np.abs(rig.image.position_command - self._pose).max() > SETTLED_RAD:
            rig.move(rig.all, self._pose)
            rig.rest()
        return rig

    def clear(self) -> None:
        """Shut the shared rig down."""
        rig, self._shared = self._shared, None
        if rig is not None:
            rig.down()


def _find(robot: str) -> RobotDescriptor:
    """A robot of robotd, of a plugin, or a file."""
    robots, _ = register_all(load_plugins()[0])
    return load_robot_descriptor(robot, search_path=(*default_search_path(), *robots.folders))


class BenchOrSkip:
    """A bench on which "cannot do that" skips the check."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench

    @classmethod
    def of(cls, rig: Rig) -> Bench:
        """The bench of ``rig``; skips where there is none."""
        if rig.bench is None:
            pytest.skip(f"the {rig.robot.backend.name} backend offers no bench (robotd_bench)")
        return cast(Bench, cls(rig.bench))

    def __getattr__(self, name: str) -> Callable[..., Any]:
        method = getattr(self._bench, name)

        def call(*arguments: Any) -> Any:
            try:
                return method(*arguments)
            except Unsupported as error:
                pytest.skip(str(error))

        return call
