"""QoS profiles that nodes and their clients share."""

from __future__ import annotations

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Reliable; who subscribes later gets the newest message."""

SERVICE = QoSProfile(depth=1000)
"""The usual depth, 10, drops what exceeds it before the executor has taken it."""

STREAM = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Commands with a dead-man time: matches every publisher, and waits for no lost message."""

ROSOUT = QoSProfile(
    depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL, lifespan=Duration(seconds=10)
)
"""The profile of ``/rosout``; its values are those of rcl."""
