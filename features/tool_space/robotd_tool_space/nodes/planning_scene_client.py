"""Client of MoveIt's service ``get_planning_scene``: objects from before this process."""

from __future__ import annotations

import time
from collections.abc import Callable

from moveit_msgs.msg import PlanningSceneComponents
from moveit_msgs.srv import GetPlanningScene
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.subscription import Subscription
from rclpy.task import Future

from robotd.api import get_logger
from robotd_ros.host import RosHost

log = get_logger("tool")

SERVICE = "get_planning_scene"
PERIOD_S = 1.0  # of the checks for the service
TIMEOUT_S = 5.0  # of a response
MAX_REQUESTS = 3  # that a server leaves without a response; DDS may lose the first ones
# No octomap, which may have megabytes and is ignored.
COMPONENTS = (
    PlanningSceneComponents.ROBOT_STATE_ATTACHED_OBJECTS
    | PlanningSceneComponents.WORLD_OBJECT_GEOMETRY
)


class PlanningSceneClient:
    """Requests the whole scene of each ``move_group`` that starts, once.

    A new one is a service that was missing before, or a new publisher of its responses or of the
    topic: rclpy names the servers of a service by their topics in DDS alone.

    Args:
        host: of the node.
        node: whose executor runs the checks.
        subscription: of the topic; the service has its namespace.
        on_request: called with the future of each response, when it has been requested.
        on_end: called when such a future is done or cancelled. Both in the executor thread.
    """

    def __init__(
        self,
        host: RosHost,
        node: Node,
        subscription: Subscription,
        on_request: Callable[[Future], None],
        on_end: Callable[[], None],
    ) -> None:
        self._host, self._node, self._subscription = host, node, subscription
        self._on_request, self._on_end = on_request, on_end
        namespace = subscription.topic_name.rpartition("/")[0]
        self._client = node.create_client(GetPlanningScene, f"{namespace}/{SERVICE}")
        self._future: Future | None = None
        self._deadline_s = 0.0
        self._responses = f"rr{self.service}Reply"
        self._publishers: set[tuple[int, ...]] | None = None
        self._requests_left, self._repeat = 0, False
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(PERIOD_S, self._check, clock=steady)

    @property
    def service(self) -> str:
        """Name of the service."""
        return str(self._client.service_name)

    def repeat(self) -> None:
        """Request the scene once more, within two checks. Any thread."""
        self._repeat = True

    def _check(self) -> None:
        with self._host.callback_guard():
            if self._future is not None:
                if time.monotonic() >= self._deadline_s:
                    self._future.cancel()
                return
            known, self._publishers = self._publishers, self._find_publishers()
            if self._publishers is None:
                return
            if self._repeat or known is None or self._publishers - known:
                # A response before the topic is connected would miss the changes in between, and
                # its publisher may need longer than this side: request it at the next check.
                self._requests_left, self._repeat = MAX_REQUESTS, False
            elif self._requests_left > 0:
                self._request()

    def _find_publishers(self) -> set[tuple[int, ...]] | None:
        """Return ids of publishers, of responses and of the topic; None: no service."""
        if not self._client.service_is_ready():
            return None
        found = [
            *self._node.get_publishers_info_by_topic(self._subscription.topic_name),
            *self._node.get_publishers_info_by_topic(self._responses, no_mangle=True),
        ]
        return {tuple(info.endpoint_gid) for info in found}

    def _request(self) -> None:
        self._requests_left -= 1
        self._deadline_s = time.monotonic() + TIMEOUT_S
        components = PlanningSceneComponents(components=COMPONENTS)
        self._future = self._client.call_async(GetPlanningScene.Request(components=components))
        self._on_request(self._future)
        self._future.add_done_callback(self._ended)

    def _ended(self, future: Future) -> None:
        with self._host.callback_guard():
            self._future = None
            if not future.cancelled():
                self._requests_left = 0
            elif self._requests_left == 0:
                log.warning(
                    "no planning scene from MoveIt: objects that it had before are not avoided",
                    service=self.service,
                    requests=MAX_REQUESTS,
                    wait_s=TIMEOUT_S,
                )
            self._on_end()
