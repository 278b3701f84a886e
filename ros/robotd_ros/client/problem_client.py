"""Problems of a running robot, from its latched topic."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from diagnostic_msgs.msg import DiagnosticArray

from robotd.control.problem import Problem, ProblemKind
from robotd.errors import DeviceTimeout, OperationError
from robotd_ros.client.ros_client import RosClient
from robotd_ros.node_registry import OPERATOR_NODE
from robotd_ros.problem_messages import read_problems
from robotd_ros.qos import LATCHED

PROBLEMS = f"{OPERATOR_NODE}/problems"
DISCOVERY_S = 1.0
NOT_READY = (ProblemKind.STARTING, ProblemKind.ENDING, ProblemKind.DEVICE)
STANDING = (*NOT_READY, ProblemKind.STOPPED, ProblemKind.PAUSED)


class ProblemListener:
    """Subscription of the problems; ``stack`` closes it. One thread."""

    def __init__(self, client: RosClient, stack: ExitStack) -> None:
        self._messages = stack.enter_context(client.listen(DiagnosticArray, PROBLEMS, LATCHED))

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
        return next((each for each in self.newest if each.kind in kinds), None)


def with_remedy(problem: Problem) -> str:
    """Return a problem in one line, with what to do about it."""
    return f"{problem}. {problem.remedy}" if problem.remedy else str(problem)


def require(client: RosClient, *kinds: ProblemKind) -> None:
    """Raise OperationError, with the reason and the remedy, for a problem of one of ``kinds``.

    A system without the node ``robotd`` cannot be asked: no effect.
    """
    with ExitStack() as stack:
        problems = ProblemListener(client, stack)
        try:
            client.wait(lambda: problems.is_known, PROBLEMS, DISCOVERY_S)
        except DeviceTimeout:
            return
        if problem := problems.first(*kinds):
            raise OperationError(with_remedy(problem))


def require_ready(client: RosClient) -> None:
    """Raise OperationError, with the robot's reason and what helps, unless axes take commands."""
    require(client, *NOT_READY)


def require_motion(client: RosClient) -> None:
    """Raise OperationError while goals would be rejected, or wait: not ready, stopped or paused."""
    require(client, *STANDING)


@contextmanager
def reason_of_silence(client: RosClient) -> Iterator[None]:
    """Check ``require_ready`` before the block, and again when its DeviceTimeout comes out.

    On a busy computer the topic may be discovered only during the block.
    """
    require_ready(client)
    try:
        yield
    except DeviceTimeout:
        require_ready(client)
        raise
