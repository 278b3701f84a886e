"""Services, topic and action of programs on the node ``robotd``.

``~/program`` has the state of the newest program. The action ``~/run_program`` runs, resumes, or
executes one step.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

from robotd_msgs.action import RunProgram
from robotd_msgs.msg import ProgramState as StateMessage
from robotd_msgs.srv import CheckProgram
from std_srvs.srv import Trigger

from robotd.api import InvalidArgument, RobotdError, get_logger
from robotd.api.robots import Outcome
from robotd_ros.nodes.latched_topics import publish_if_alive
from robotd_ros.qos import LATCHED
from robotd_ros.run_nodes import NodeContext
from robotd_ros.services import add_service
from robotd_ros.worker_action import WorkerAction
from robotd_teach.program_code import Program
from robotd_teach.programs import ACTIVE, Programs

STATE = "~/program"
ACTION = "~/run_program"
FEEDBACK_S = 0.1
log = get_logger("program")


class ProgramServices:
    """Services and topic of the programs of a robot."""

    def __init__(self, context: NodeContext, programs: Programs) -> None:
        self._programs = programs
        node, host = context.operator, context.host
        self._topic = node.create_publisher(StateMessage, STATE, LATCHED)
        add_service(node, host, CheckProgram, f"{STATE}/check", self._check)
        calls: dict[str, Callable[[], str]] = {
            "stop": programs.stop, "pause": programs.pause, "proceed": programs.proceed
        }  # fmt: skip
        for name, call in calls.items():
            self._add(context, name, call)
        programs.on_change = self._publish
        self._publish()

    def _add(self, context: NodeContext, name: str, call: Callable[[], str]) -> None:
        add_service(
            context.operator,
            context.host,
            Trigger,
            f"{STATE}/{name}",
            lambda request, response: call(),
            urgent=name != "proceed",
        )

    def _check(self, request: Any, response: Any) -> str:
        program = Program.parse(request.text, request.file)
        self._programs.check(program)
        return f"{program.path}: {program.steps} steps can be executed from where the arm is"

    def _publish(self) -> None:
        publish_if_alive(self._topic, StateMessage(**self._programs.state._asdict()))


class ProgramAction(WorkerAction):
    """Runs programs. A goal that cannot be is aborted with its reason, before anything moves."""

    def __init__(self, context: NodeContext, programs: Programs) -> None:
        self._programs = programs
        super().__init__(context.operator, context.host, RunProgram, ACTION, log)

    def execute(
        self, goal: Any, result: Any, after: ExitStack, *arrived: Any
    ) -> tuple[Outcome, str]:
        request, programs = goal.request, self._programs
        tick = self._ticker(goal)
        try:
            if request.mode == RunProgram.Goal.RESUME:
                programs.resume(tick)
            elif request.mode == RunProgram.Goal.STEP:
                programs.step(Program.parse(request.text, request.file), tick)
            elif request.mode == RunProgram.Goal.RUN:
                programs.run(Program.parse(request.text, request.file), tick)
            else:
                raise InvalidArgument(f"mode is {request.mode}, must be 0, 1 or 2")
        except RobotdError as error:
            result.message, result.step = str(error), programs.state.step
            if goal.is_cancel_requested:
                return Outcome.CANCELED, result.message
            raise
        state = programs.state
        result.success, result.step = True, state.step
        result.message = f"{state.file}: {state.executed} steps were executed"
        if state.reason:
            result.message = f"{state.file}: {state.reason}"
        if (found := programs.contact) is not None:
            contact = found.contact
            result.message += (
                f"; contact in step {found.step}: {contact.change:.2f} {contact.unit} at"
                f" {contact.joint or contact.link}, at rest {found.stop} further"
            )
        return Outcome.SUCCEEDED, result.message

    def fill_failure(self, result: Any, error: Exception, text: str) -> None:
        result.message = text

    def _ticker(self, goal: Any) -> Callable[[], None]:
        """Return what publishes the feedback, and stops the program once the client cancels."""
        message, due_s = RunProgram.Feedback(), 0.0

        def tick() -> None:
            nonlocal due_s
            if goal.is_cancel_requested:
                raise CanceledByClient("canceled by the client")
            if time.monotonic() < due_s:
                return
            due_s = time.monotonic() + FEEDBACK_S
            state = self._programs.state
            if state.state in ACTIVE:  # while it is checked that of the program before
                message.state, message.key, message.text = state.state, state.key, state.text
                message.step, message.steps, message.line = state.step, state.steps, state.line
                message.executed, message.progress = state.executed, state.progress
            goal.publish_feedback(message)

        return tick


class CanceledByClient(InvalidArgument):
    """The client has canceled its goal."""
