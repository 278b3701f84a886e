"""Health of a robot, part by part, independent of ROS."""
