"""Simulated EtherCAT slaves: slave controllers with CoE, process data and distributed clocks.

Independent of the backend: written from the public descriptions of ETG.1000 and CiA 402.
"""

from robotd_ethercat.simulated.bus import Bus
from robotd_ethercat.simulated.generic_slave import GenericSlave
from robotd_ethercat.simulated.line import Line, Port
from robotd_ethercat.simulated.sii import Identity
from robotd_ethercat.simulated.slave import Slave

__all__ = ["Bus", "GenericSlave", "Identity", "Line", "Port", "Slave"]
