"""Names of robotd's own nodes, and of topics that clients find a robot by. Imports no ROS."""

from __future__ import annotations

OPERATOR_NODE = "robotd"  # made in addition to the others of every robot
WORLD_NODE = "robotd_world"  # made for a robot whose backend has a world
STOP_ALL = f"/{OPERATOR_NODE}/stop_all"  # std_msgs/Empty: stops every robot of the ROS domain
IDENTITY = f"{OPERATOR_NODE}/robot"  # std_msgs/String: which robot answers, as JSON
SUMMARY = f"{OPERATOR_NODE}/summary"  # std_msgs/String: identity and state, as JSON
