"""ROS nodes of tool space, and the services of the robot's node.

Callbacks run in the threads of the executor.
"""
