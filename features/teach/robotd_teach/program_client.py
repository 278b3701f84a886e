"""Programs of a running robot, as a client sees them."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from robotd_msgs.action import RunProgram
from std_msgs.msg import String

from robotd_ros.client.motion_client import Ending, GoalRun
from robotd_ros.client.ros_client import RosClient
from robotd_ros.qos import LATCHED

TOPIC = "robotd/program"
ACTION = "robotd/run_program"
MODES = {
    "run": RunProgram.Goal.RUN,
    "step": RunProgram.Goal.STEP,
    "resume": RunProgram.Goal.RESUME,
}


def program_state(client: RosClient) -> dict[str, Any]:
    """Return the fields of ``ProgramState``. Raises DeviceTimeout."""
    with client.listen(String, TOPIC, LATCHED) as messages:
        told: dict[str, Any] = json.loads(messages.wait().data)
    return told


def execute(
    client: RosClient,
    mode: str,
    is_canceled: Callable[[], bool],
    on_progress: Callable[[Any], None],
    *,
    file: str = "",
    text: str = "",
) -> tuple[Ending, str]:
    """Run a program, resume it or execute a step; return at its end, with the robot's text.

    Args:
        mode: a key of ``MODES``.
        is_canceled: asked all the time; once it is true, the program is stopped.
        on_progress: called with each feedback.

    Raises DeviceTimeout: no answer or no feedback in time.
    """
    run = GoalRun(client, RunProgram, on_progress, lambda result: str(result.message))
    return run.run(ACTION, RunProgram.Goal(mode=MODES[mode], file=file, text=text), is_canceled)
