"""Stop of a robot, by message and service, repeated until it is confirmed.

The message on the topic goes first: it needs one endpoint, the service two in each direction, and
half of the processor time of the command to be made. The message is repeated until the robot's
latched reason shows that it has come, and then the service is called until it answers, which is at
standstill. Both may come twice: a stop of what is stopped has no effect. Where robots share a
namespace, the service reaches those that are discovered by then, and one answers: the message goes
to each other one.
"""

from __future__ import annotations

import time
from typing import Any

from rclpy.duration import Duration
from std_msgs.msg import Empty, String
from std_srvs.srv import Trigger

from robotd.errors import OperationError
from robotd.log import escaped
from robotd_ros.client.ros_client import RosClient
from robotd_ros.node_names import OPERATOR_NODE, STOP_ALL
from robotd_ros.qos import LATCHED

REPEAT_S = 0.1
SERVICE_AFTER_S = 0.5  # without an effect of the message
DELIVERY_S = 1.0  # of the message to several robots
RETRY_S = 3.0  # of a call whose answer does not come; the robot may take as long to come to rest


class StopOfAll:
    """Stop of all robots of the ROS domain by one message, before any of them is looked up.

    It says nothing of who has got it: see ``StopRequest``. One thread, the client's.
    """

    def __init__(self, client: RosClient) -> None:
        self._node = client.node
        self._publisher = client.node.create_publisher(Empty, STOP_ALL, 1)
        self._reached, self._message_s = 0, 0.0

    def send(self, *, again: bool) -> None:
        """Send it to robots that are newly discovered, and every ``REPEAT_S`` to all if ``again``.

        After each event of the client.
        """
        count, now_s = self._publisher.get_subscription_count(), time.monotonic()
        if count > self._reached or (again and count and now_s >= self._message_s + REPEAT_S):
            self._message_s = now_s
            self._publisher.publish(Empty())
        self._reached = count

    def close(self) -> None:
        """Destroy the publisher."""
        self._node.destroy_publisher(self._publisher)


class StopRequest:
    """Stop of the robots of one namespace. One thread, the client's.

    Args:
        client: started.
        namespace: of the robots; "" for the client's own.

    Attributes:
        answer: of the service, which is given at standstill; "" before.
        failure: of the service: axes still move; "" for none.
    """

    def __init__(self, client: RosClient, namespace: str = "") -> None:
        prefix = f"{namespace.rstrip('/')}/" if namespace else ""
        self.answer = self.failure = ""
        self._client, node = client, client.node
        self._publisher = node.create_publisher(Empty, f"{prefix}{OPERATOR_NODE}/stop", 1)
        self._stopped = client.listen(String, f"{prefix}{OPERATOR_NODE}/stopped", LATCHED)
        self._service_name = f"{prefix}{OPERATOR_NODE}/stop"
        self._service: Any = None  # it is made when the message was sent
        self._began_s = time.monotonic()
        self._call: Any = None
        self._call_s = -RETRY_S
        self._message_s = 0.0
        self._reached = 1

    def advance(self) -> None:
        """Send what is due, and take the answer; after each event of the client."""
        self.reaches(1)
        if self.is_done:
            return
        now_s = time.monotonic()
        is_found = self._publisher.get_subscription_count() > 0
        if is_found and not self.is_engaged and now_s >= self._message_s + REPEAT_S:
            self._message_s = now_s
            self._publisher.publish(Empty())
        if self._service is None:
            if self.is_engaged or now_s >= self._began_s + SERVICE_AFTER_S:
                self._service = self._client.node.create_client(Trigger, self._service_name)
        elif self._call is not None and self._call.done():
            response, self._call = self._call.result(), None
            text = escaped(response.message)
            self.answer, self.failure = (text, "") if response.success else ("", text)
        elif self._service.service_is_ready() and now_s >= self._call_s + RETRY_S:
            if self._call is not None:
                self._service.remove_pending_request(self._call)
            self._call_s = now_s
            self._call = self._service.call_async(Trigger.Request())

    def reaches(self, robots: int) -> bool:
        """Return whether this many robots have got the stop, and send it to further ones."""
        count = self._publisher.get_subscription_count()
        if count > self._reached:
            self._publisher.publish(Empty())
        self._reached = max(1, count)
        return self._reached >= robots

    @property
    def is_engaged(self) -> bool:
        """A robot has latched a stop: it is at rest, or comes to rest."""
        return self._stopped.newest is not None and bool(self._stopped.newest.data)

    @property
    def is_done(self) -> bool:
        """The service has answered."""
        return bool(self.answer or self.failure)

    @property
    def progress(self) -> str:
        """State for people, while it is not done."""
        if self.is_engaged:
            return "stopped, standstill is not confirmed yet"
        is_served = self._service is not None and self._service.service_is_ready()
        if self._publisher.get_subscription_count() or is_served:
            return "found, no confirmation yet"
        own = self._client.node.get_namespace()
        return f"no robot found yet in namespace {own} (robotd stop --all: in all)"

    def close(self) -> None:
        """Destroy its publishers and clients at the client's node."""
        if self._reached > 1:
            self._publisher.wait_for_all_acked(Duration(seconds=DELIVERY_S))
        self._stopped.__exit__()
        self._client.node.destroy_publisher(self._publisher)
        if self._service is not None:
            self._client.node.destroy_client(self._service)

    def result(self) -> str:
        """Return the answer. Raises OperationError with the robot's reason: axes still move."""
        if self.failure:
            raise OperationError(self.failure)
        return self.answer
