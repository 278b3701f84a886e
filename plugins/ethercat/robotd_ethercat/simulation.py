"""Simulated slaves of a robot, started with its device: option ``simulated``."""

from __future__ import annotations

from collections.abc import Callable
from tempfile import NamedTemporaryFile

from robotd.api import ConnectError, RobotDescriptor
from robotd_ethercat.bus_namespace import missing_rights, run_in_namespace
from robotd_ethercat.plan import BusPlan
from robotd_ethercat.simulated_robot import SimulatedSection
from robotd_ethercat.slaves_process import SlavesProcess


class Simulation:
    """Slaves of the plan, in their own process, on a virtual cable. Worker threads."""

    def __init__(self, robot: RobotDescriptor, plan: BusPlan) -> None:
        self._section = SimulatedSection.of_robot(robot)
        self._redundant = plan.options.redundant_interface is not None
        self._slaves: SlavesProcess | None = None

    def start(self) -> None:
        """Power on. Raises ConnectError naming what this computer lacks."""
        if self._slaves is not None:
            return
        if (missing := missing_rights()) is not None:
            raise ConnectError("no simulated slaves", {"ethercat": missing}, permanent=True)
        with NamedTemporaryFile("w", suffix=".json") as file:
            file.write(self._section.to_json())
            file.flush()
            redundant = ["--redundant"] if self._redundant else []
            slaves = SlavesProcess(["--section", file.name, *redundant])
            try:
                slaves.start()
            except RuntimeError as error:
                raise ConnectError("no simulated slaves", {"ethercat": str(error)}) from error
        self._slaves = slaves

    def stop(self) -> None:
        """Power off. Twice is not an error."""
        slaves, self._slaves = self._slaves, None
        if slaves is not None:
            slaves.stop()

    @property
    def pid(self) -> int:
        """Process id of the slaves. Raises ConnectError while powered off."""
        return self._running().pid

    def run(self, action: Callable[[], None]) -> None:
        """Run ``action`` where the interfaces are. Raises ConnectError while powered off."""
        run_in_namespace(self._running().namespace, action)

    def inject(self, line: str) -> str:
        """Carry out a fault command. Raises ConnectError while powered off, ValueError."""
        return self._running().inject(line)

    def _running(self) -> SlavesProcess:
        if self._slaves is None:
            raise ConnectError("the simulated slaves are not running")
        return self._slaves
