"""What a backend can do, as data: the core and the tests decide by it, never by a name."""

from __future__ import annotations

from enum import StrEnum


class Capability(StrEnum):
    """One feature that not every backend has."""

    AXES = "axes"
    IO = "io"
    FIELDBUS = "fieldbus"
    VELOCITY_MODE = "velocity_mode"
    TORQUE_MODE = "torque_mode"
    HOMING = "homing"
    PARAMETERS_FILE = "parameters_file"
    SCALING = "scaling"  # gear ratio and polarity can be changed at run time
    REGISTER_READ = "register_read"
    STATISTICS = "statistics"
    HOT_CONNECT = "hot_connect"
    TRAJECTORIES_ON_DEVICE = "trajectories_on_device"  # it gets the points and joins them itself
    DEVICE_WATCHDOG = "device_watchdog"  # axes stop by themselves when the daemon dies
    SIMULATED = "simulated"  # nothing real moves
