"""Optional features of a backend, as data for core and tests."""

from __future__ import annotations

from enum import StrEnum


class Capability(StrEnum):
    """One feature that not every backend has. A feature that is missing is answered Unsupported.

    Derived from the hooks that a backend has, never declared:

    - AXES: ``robotd_axes``
    - IO: ``robotd_io``
    - FIELDBUS: ``robotd_fieldbus``
    - PAYLOAD: ``robotd_payload``

    Declared in ``BackendInfo``, together with the methods that they need:

    - VELOCITY_MODE: velocity commands (``AxisDriver.jog``) and velocity streams, in a mode of
      their own (``set_command_mode``). Without it ``jog`` is never called.
    - TORQUE_MODE: torque setpoints (``AxisDriver.stream_torque``), in a mode of their own
      (``set_command_mode``).
    - HAND_GUIDING: a person can move the axes by hand (``AxisDriver.begin_guiding``).
    - FALLS_WHEN_GUIDED: with HAND_GUIDING: nothing carries guided axes, somebody has to hold them.
    - HOMING: the present position can become zero (``home``).
    - SCALING: gear ratio and polarity change at run time (``set_gear_ratio``, ``set_polarity``).
    - PARAMETERS_FILE: the device takes a parameter file (``DeviceDriver.load_parameters``,
      ``dump_parameters``).
    - TRAJECTORIES_ON_DEVICE: the device gets all points of a trajectory and interpolates
      (``AxisDriver.follow``). Without it positions are streamed (``begin_stream``, ``stream``,
      ``end_stream``).
    - CONTROLLER_ALARM: the controller has one alarm for all axes, not one for each
      (``ProcessImage.set_controller_alarm``).
    - REGISTER_READ, STATISTICS, HOT_CONNECT: methods of the fieldbus driver
      (``read_register``, ``reset_statistics``, ``start_hot_connect``).
    - OBJECTS: objects of the nodes, SDO, are read and written at run time, by the fieldbus driver
      (``read_object``, ``write_object``).
    - DEVICE_WATCHDOG: moving axes stop by themselves within a second when setpoints or the process
      end.
    - SIMULATED: nothing real moves.
    - CONTACTS: with SIMULATED: links touch each other and objects, so that the axes together do not
      reach all positions within their limits.
    """

    AXES = "axes"
    IO = "io"
    FIELDBUS = "fieldbus"
    PAYLOAD = "payload"
    VELOCITY_MODE = "velocity_mode"
    TORQUE_MODE = "torque_mode"
    HAND_GUIDING = "hand_guiding"
    FALLS_WHEN_GUIDED = "falls_when_guided"
    HOMING = "homing"
    PARAMETERS_FILE = "parameters_file"
    SCALING = "scaling"
    REGISTER_READ = "register_read"
    STATISTICS = "statistics"
    HOT_CONNECT = "hot_connect"
    OBJECTS = "objects"
    TRAJECTORIES_ON_DEVICE = "trajectories_on_device"
    CONTROLLER_ALARM = "controller_alarm"
    DEVICE_WATCHDOG = "device_watchdog"
    SIMULATED = "simulated"
    CONTACTS = "contacts"


DERIVED = frozenset({Capability.AXES, Capability.IO, Capability.FIELDBUS, Capability.PAYLOAD})
"""Capabilities that follow from the hooks of a backend."""
