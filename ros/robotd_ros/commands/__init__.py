"""Commands for a running robot: clients over ROS."""
