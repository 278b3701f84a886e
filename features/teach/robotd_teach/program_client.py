"""Programs of a running robot, as a client sees them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from robotd_msgs.action import RunProgram
from robotd_msgs.msg import ProgramState
from robotd_msgs.srv import CheckProgram

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
    """Return the state of the newest program by field. Raises DeviceTimeout."""
    with client.listen(ProgramState, TOPIC, LATCHED) as messages:
        message = messages.wait()
    return {name: getattr(message, name) for name in message.get_fields_and_field_types()}


def check(client: RosClient, file: str, text: str) -> str:
    """Check a program; return the robot's text. Raises the errors of ``call``."""
    return str(client.call(CheckProgram, f"{TOPIC}/check", file=file, text=text).message)


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
