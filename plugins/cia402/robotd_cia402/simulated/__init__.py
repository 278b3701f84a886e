"""Simulated CiA 402 drives, independent of the bus and of the backends.

Written from CiA 402-2; no code in common with the master's side. A bus model owns the objects of a
drive as a dict (index, subindex) → integer, and calls ``Drive`` once for each cyclic frame.
"""

from robotd_cia402.simulated.drive import Drive, DriveFaults, DriveModel
from robotd_cia402.simulated.drive_dictionary import (
    DRIVE_OBJECTS,
    DriveObject,
    Objects,
    drive_defaults,
)
from robotd_cia402.simulated.motors import Motors
from robotd_cia402.simulated.scale import Scale, Switches

__all__ = [
    "DRIVE_OBJECTS",
    "Drive",
    "DriveFaults",
    "DriveModel",
    "DriveObject",
    "Motors",
    "Objects",
    "Scale",
    "Switches",
    "drive_defaults",
]
