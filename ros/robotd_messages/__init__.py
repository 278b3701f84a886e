"""ROS messages as CDR bytes, without ROS."""
