"""Objects that callers hold: joint groups, streams, the base, servos, recovery, problems.

ROS nodes, features and programs call it, in worker threads: most calls block until a plan is made,
an axis rests or a drive has answered. Sending a command to an open stream or to the base never
blocks, so that any thread may. What happens in a period is in the layers below.
"""
