"""Codes of robotd itself: results of goals, and exit statuses."""

from __future__ import annotations

from robotd.plugin.code_table import CodeTable

# control_msgs/action/FollowJointTrajectory, with what robotd means by each.
GOAL_RESULTS = CodeTable(
    "result of a trajectory goal",
    {
        0: "SUCCESSFUL: the goal was reached, or canceled by its client",
        -1: "INVALID_GOAL: rejected, preempted, stopped or ended by a fault; the text says which",
        -2: "INVALID_JOINTS: names of joints are unknown, missing or doubled",
        -3: "OLD_HEADER_TIMESTAMP: the start time is over",
        -4: "PATH_TOLERANCE_VIOLATED: a joint left its path; the text names joint and error",
        -5: "GOAL_TOLERANCE_VIOLATED: a joint was not at the goal within goal_time_s",
    },
    digits=0,
)
