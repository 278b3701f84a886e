"""Simulated EtherCAT slaves: slave controllers with CoE, process data and distributed clocks.

Independent of the backend: written the public descriptions of ETG.1000 and CiA 402.
"""

from robotd_ethercat.simulated.bus import Bus
from robotd_ethercat.simulated.io_module import GENERIC, VENDOR, GenericSlave, IoModule
from robotd_ethercat.simulated.line import Line, MotionClock, Port
from robotd_ethercat.simulated.servo_drive import ServoDrive
from robotd_ethercat.simulated.sii_content import Identity
from robotd_ethercat.simulated.simulated_slave import Slave

__all__ = [
    "GENERIC",
    "VENDOR",
    "Bus",
    "GenericSlave",
    "Identity",
    "IoModule",
    "Line",
    "MotionClock",
    "Port",
    "ServoDrive",
    "Slave",
]
