"""CiA 402 drives and a CiA 401 module as real nodes on a python-can bus.

Independent of the backend: dictionaries come from EDS files, SDO and EMCY from the
``canopen`` library, everything else is written from CiA 301 and 401. The drives themselves are
those of ``robotd_cia402.simulated``.
"""

from robotd_canopen.simulated.network import DriveNode, IoNode, SimulatedNetwork
from robotd_canopen.simulated.simulated_node import Faults, SimulatedNode

__all__ = [
    "DriveNode",
    "Faults",
    "IoNode",
    "SimulatedNetwork",
    "SimulatedNode",
]
