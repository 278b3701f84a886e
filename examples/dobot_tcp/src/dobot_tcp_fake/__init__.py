"""A stand-in for a Dobot CR controller, as a process, and the backend dobot_tcp_fake.

It is written for tests, from the vendor's public description and not from a controller. It does
not model: dynamics and following errors (joints move evenly to each target), Cartesian motion,
scripts and queued commands, brakes, drag mode, payload, collision detection, the parameters
``aheadtime`` and ``gain``, most of the commands and about seventy fields of the feedback. It
enables at once. Alarms that it raises by itself have numbers of its own.
"""
