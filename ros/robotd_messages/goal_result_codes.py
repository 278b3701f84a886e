"""Results of control_msgs/action/FollowJointTrajectory, with what robotd means by each."""

from robotd.api import CodeTable

_REMEDIES = {
    -1: "Read the text of the result: it names joint, value and limit, or what stopped the goal",
    -2: "Compare the names with `robotd status` or the topic joint_states",
    -3: "Set header.stamp to 0 (now) or to a time to come, and compare the clocks of the computers",
    -4: "Look for a blocked or overloaded joint; drive slower, or set another path tolerance",
    -5: "Look for a blocked joint; set goal_time_s or the goal tolerance to what the drive reaches",
}

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
    remedy=lambda code: _REMEDIES.get(code, ""),
)
