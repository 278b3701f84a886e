"""Plugin-based robot driver framework for ROS 2."""
