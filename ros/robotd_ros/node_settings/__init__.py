"""Settings of the built-in ROS nodes, read from their parameters; without ROS.

The same functions read them where ROS is not there (``robotd check``) and where a node declares
its parameters. ``robotd_ros.plugin`` names the one of each node.
"""
