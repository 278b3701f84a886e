"""Check of the section ``backends.canopen`` against the robot and the EDS files."""

from __future__ import annotations

from typing import TYPE_CHECKING

from robotd.api import RobotDescriptor
from robotd_canopen.options import CanopenOptions

if TYPE_CHECKING:
    from robotd_canopen.layout import NetworkLayout


class CanopenSection(CanopenOptions):
    """The section ``backends.canopen``, from which the network is planned."""

    def check_robot(self, robot: RobotDescriptor) -> NetworkLayout:
        """Plan the network, which takes the robot and the EDS files. Raises DescriptorError."""
        from robotd_canopen.layout import plan_network

        return plan_network(robot, self)
