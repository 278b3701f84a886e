"""ROS nodes and the topics they publish."""
