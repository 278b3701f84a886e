"""The packet of the feedback, field after field as the maker's guide lists them."""

from __future__ import annotations

import numpy as np

TEST_VALUE = 0x0123456789ABCDEF
SIZE = 1440
PACKET = np.dtype(
    [
        ("length", "<u8"), ("digital_inputs", "<u8"), ("digital_outputs", "<u8"),
        ("robot_mode", "<u8"), ("time_stamp", "<u8"), ("run_time", "<u8"), ("test_value", "<u8"),
        ("reserved_1", "<f8"), ("speed_scaling", "<f8"), ("linear_momentum", "<f8"),
        ("v_main", "<f8"), ("v_robot", "<f8"), ("i_robot", "<f8"), ("reserved_2", "<f8", 2),
        ("tool_acceleration", "<f8", 3), ("elbow", "<f8", 3), ("elbow_velocity", "<f8", 3),
        ("q_target", "<f8", 6), ("qd_target", "<f8", 6), ("qdd_target", "<f8", 6),
        ("i_target", "<f8", 6), ("m_target", "<f8", 6), ("q_actual", "<f8", 6),
        ("qd_actual", "<f8", 6), ("i_actual", "<f8", 6), ("actual_tcp_force", "<f8", 6),
        ("tool_vector_actual", "<f8", 6), ("tcp_speed_actual", "<f8", 6), ("tcp_force", "<f8", 6),
        ("tool_vector_target", "<f8", 6), ("tcp_speed_target", "<f8", 6),
        ("motor_temperatures", "<f8", 6), ("joint_modes", "<f8", 6), ("v_actual", "<f8", 6),
        ("hand_type", "u1", 4), ("user_index", "u1"), ("tool_index", "u1"), ("queue_running", "u1"),
        ("pause_flag", "u1"), ("ratios", "u1", 9), ("brake_status", "u1"), ("enable_status", "u1"),
        ("drag_status", "u1"), ("running_status", "u1"), ("error_status", "u1"),
        ("jog_status", "u1"), ("robot_type", "u1"), ("buttons", "u1", 5), ("force_online", "u1"),
        ("reserved_3", "u1", 66), ("vibration", "<f8"), ("command_id", "<u8"),
        ("m_actual", "<f8", 6), ("load", "<f8"), ("load_center", "<f8", 3), ("user", "<f8", 6),
        ("tool_frame", "<f8", 6), ("trace_index", "<f8"), ("six_force", "<f8", 6),
        ("target_quaternion", "<f8", 4), ("actual_quaternion", "<f8", 4),
        ("auto_manual", "u1", 2), ("reserved_4", "u1", 22),
    ]
)  # fmt: skip
assert PACKET.itemsize == SIZE
