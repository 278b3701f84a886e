"""Check of the section ``backends.ethercat`` against the robot."""

from __future__ import annotations

from typing import TYPE_CHECKING

from robotd.api import RobotDescriptor
from robotd_ethercat.options import EthercatOptions

if TYPE_CHECKING:
    from robotd_ethercat.plan import BusPlan


class EthercatSection(EthercatOptions):
    """The section ``backends.ethercat``, from which the bus is planned."""

    def check_robot(self, robot: RobotDescriptor) -> BusPlan:
        """Plan the bus. Raises DescriptorError with every problem."""
        from robotd_ethercat.plan import plan_bus

        return plan_bus(robot, self)
