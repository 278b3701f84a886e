"""CiA 402 drives and a CiA 401 module as real nodes on a python-can bus.

Independent of the backend: dictionaries come from EDS files, SDO and EMCY from the
``canopen`` library, everything else is written from CiA 301, 401 and 402.
"""

from robotd_canopen.simulated.device_nodes import DriveNode, IoNode
from robotd_canopen.simulated.drive import Drive, DriveModel
from robotd_canopen.simulated.motors import Motors
from robotd_canopen.simulated.network import SimulatedNetwork
from robotd_canopen.simulated.node_faults import Faults
from robotd_canopen.simulated.scale import Scale, Switches
from robotd_canopen.simulated.simulated_node import SimulatedNode

__all__ = [
    "Drive",
    "DriveModel",
    "DriveNode",
    "Faults",
    "IoNode",
    "Motors",
    "Scale",
    "SimulatedNetwork",
    "SimulatedNode",
    "Switches",
]
