"""A pneumatic gripper on one output bit."""

from __future__ import annotations

from robotd.descriptor import GripperDescriptor
from robotd.device.io import Io


class Gripper:
    """Opens and closes by an output bit; where the fingers are is told from that bit.

    The valve has no sensor: ``closed`` is what was commanded, not what was felt.
    """

    def __init__(self, io: Io, descriptor: GripperDescriptor) -> None:
        self.joints = tuple(descriptor.joints)
        self._io = io
        self._byte = descriptor.output_byte
        self._bit = descriptor.output_bit
        self.closed = io.output_watcher(self._byte, self._bit)

    def command(self, closed: bool) -> None:
        """Close (True) or open the gripper. Raises NotReady while the engine is not ready."""
        self._io.set_output_bit(self._byte, self._bit, closed)
