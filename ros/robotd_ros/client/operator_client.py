"""Node ``robotd`` of a running robot: its problems, recovery and outputs."""

from __future__ import annotations

import posixpath
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Point
from robotd_msgs.msg import IoLevels, RecoveryReport
from robotd_msgs.srv import GetPayload, SetPayload, SetSpeed
from std_srvs.srv import Trigger

from robotd.control.groups.problem import Problem, ProblemKind
from robotd.errors import DeviceTimeout, InvalidArgument, OperationError, unknown_name
from robotd_ros.client.ros_client import RosClient
from robotd_ros.node_names import OPERATOR_NODE
from robotd_ros.operator_messages import LEVELS, RECOVERY, read_levels
from robotd_ros.problem_messages import read_problems
from robotd_ros.qos import LATCHED

SPEED = f"{OPERATOR_NODE}/speed"
PROBLEMS = f"{OPERATOR_NODE}/problems"
DISCOVERY_S = 1.0
NOT_READY = (ProblemKind.STARTING, ProblemKind.ENDING, ProblemKind.DEVICE)
BLOCKING = (*NOT_READY, ProblemKind.STOPPED, ProblemKind.PAUSED)


class ProblemListener:
    """Subscription of the problems; ``stack`` closes it. One thread.

    ``namespace``: of the robot; "" for the client's own.
    """

    def __init__(self, client: RosClient, stack: ExitStack, namespace: str = "") -> None:
        topic = posixpath.join(namespace, PROBLEMS)
        self._messages = stack.enter_context(client.listen(DiagnosticArray, topic, LATCHED))

    @property
    def is_known(self) -> bool:
        """The robot has sent its problems."""
        return self._messages.newest is not None

    @property
    def newest(self) -> tuple[Problem, ...]:
        """Those known so far; never waits."""
        return read_problems(self._messages.newest) if self.is_known else ()

    def wait(self) -> tuple[Problem, ...]:
        """Return all, when they are known. Raises DeviceTimeout."""
        self._messages.wait()
        return self.newest

    def first(self, *kinds: ProblemKind) -> Problem | None:
        """Return the first one of ``kinds``, None without one; never waits."""
        return next((event for event in self.newest if event.kind in kinds), None)


def with_remedy(problem: Problem) -> str:
    """Return a problem in one line, with what to do about it."""
    return f"{problem}. {problem.remedy}" if problem.remedy else str(problem)


def require(client: RosClient, namespace: str, *kinds: ProblemKind) -> None:
    """Raise OperationError, with the reason and the remedy, for a problem of one of ``kinds``.

    ``namespace``: of the robot, here and below; "" for the client's own. A system without the node
    ``robotd`` cannot be asked: no effect.
    """
    with ExitStack() as stack:
        problems = ProblemListener(client, stack, namespace)
        try:
            client.wait(lambda: problems.is_known, PROBLEMS, DISCOVERY_S)
        except DeviceTimeout:
            return
        if problem := problems.first(*kinds):
            raise OperationError(with_remedy(problem))


def require_ready(client: RosClient, namespace: str = "") -> None:
    """Raise OperationError, with the robot's reason and what helps, unless axes take commands."""
    require(client, namespace, *NOT_READY)


def require_motion(client: RosClient, namespace: str = "") -> None:
    """Raise OperationError while goals would be rejected, or wait: not ready, stopped or paused."""
    require(client, namespace, *BLOCKING)


@contextmanager
def reason_of_silence(client: RosClient, namespace: str = "") -> Iterator[None]:
    """Check ``require_ready`` before the block, and again when its DeviceTimeout comes out.

    On a busy computer the topic may be discovered only during the block.
    """
    require_ready(client, namespace)
    try:
        yield
    except DeviceTimeout:
        require_ready(client, namespace)
        raise


def recover(client: RosClient, on_step: Callable[[str], None]) -> bool:
    """Recover the robot; ``on_step`` is called with each step as it is reported.

    Returns False while a stop, or a lifecycle manager, forbids motion after the recovery: the last
    step names what allows it.

    Raises:
        DeviceTimeout: no robot answers, or it has gone in between, maybe restarted.
        OperationError: the reason of the step that failed.
    """
    service = client.node.create_client(Trigger, f"{OPERATOR_NODE}/recover")
    with ExitStack() as stack, client.listen(RecoveryReport, RECOVERY, LATCHED) as report:
        problems = ProblemListener(client, stack)
        client.wait(service.service_is_ready, f"service {service.service_name}")
        before = report.wait()  # the report of the last recovery, empty before the first
        shown = 0

        def show_new() -> bool:
            """Call ``on_step`` for steps that are new; True at the end of the report."""
            nonlocal shown
            if report.newest is before:
                return False
            for step in report.newest.steps[shown:]:
                on_step(step)
                shown += 1
            return not report.newest.running

        asked = _publishers(client)
        answer = service.call_async(Trigger.Request())
        seen_s = time.monotonic()
        while not answer.done():
            client.spin()
            show_new()
            if asked & _publishers(client):  # the service may be that of a restarted robot
                seen_s = time.monotonic()
            elif time.monotonic() - seen_s > client.timeout_s:
                raise DeviceTimeout("the robot has gone during the recovery")
        response = answer.result()
        if not response.success:
            raise OperationError(response.message)
        with suppress(DeviceTimeout):  # another client's recovery may have begun meanwhile
            client.wait(show_new, "end of the report")
        problems.wait()
        if paused := problems.first(ProblemKind.PAUSED):
            on_step(with_remedy(paused))
        return problems.first(ProblemKind.STOPPED) is None


def _publishers(client: RosClient) -> set[bytes]:
    """Return which processes report a recovery: another one each time that robotd is started."""
    found = client.node.get_publishers_info_by_topic(RECOVERY)
    return {bytes(endpoint.endpoint_gid) for endpoint in found}


def set_speed(client: RosClient, speed: float) -> str:
    """Set the speed of all motion, 0 to 1; return its answer. Raises the errors of ``call``."""
    return str(client.call(SetSpeed, f"{OPERATOR_NODE}/set_speed", speed=speed).message)


def set_payload(client: RosClient, mass_kg: float, center_m: Sequence[float]) -> str:
    """Let the arm compensate a payload; return it in words. Raises the errors of ``call``.

    ``center_m``: x, y and z of its centre of mass in the frame of the flange.
    """
    x, y, z = map(float, center_m)
    values = {"mass_kg": mass_kg, "center": Point(x=x, y=y, z=z)}
    return str(client.call(SetPayload, f"{OPERATOR_NODE}/set_payload", **values).message)


def payload_text(client: RosClient) -> str:
    """Return the payload that the arm compensates, in words. Raises the errors of ``call``."""
    return str(client.call(GetPayload, f"{OPERATOR_NODE}/get_payload").message)


def set_output(client: RosClient, name: str, on: bool) -> str:
    """Set a named output; return the robot's answer.

    Raises:
        InvalidArgument: the robot has no such name.
        DeviceTimeout: no robot answers in time.
        OperationError: the robot's reason for a rejection.
    """
    with client.listen(IoLevels, LEVELS, LATCHED) as levels:
        _, outputs = read_levels(levels.wait())
    if name not in outputs:
        raise InvalidArgument(unknown_name("output", name, outputs))
    return client.switch(f"{OPERATOR_NODE}/outputs/{name}", on)
