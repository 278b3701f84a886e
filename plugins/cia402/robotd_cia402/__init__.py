"""CiA 402 drives on any fieldbus: what the CANopen and EtherCAT backends share.

A backend completes ``Cia402Master`` with its exchange, and ``DriveAccess`` with the objects of one
axis; ``Axis`` and ``Commands`` control the drive through it. ``simulated`` holds the drives' side,
which shares no code with the rest.
"""
