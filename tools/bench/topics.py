"""Topics that all subjects publish. Imports nothing, for quick processes."""

from __future__ import annotations

JOINT_STATES = "/joint_states"
COMMANDS = "/gazebo_position_controller/commands"
AXIS_STATE = "/wmx/axis/state"
AXIS_STATE_HZ = 100
STAMP_OFFSET = 4  # of header.stamp in the CDR of a message that begins with a header
