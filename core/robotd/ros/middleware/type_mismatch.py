"""Tells when a topic is offered with another type than the one that is taken.

The middleware never matches the two and says nothing, so that a base simply stands still.
"""

from __future__ import annotations

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.subscription import Subscription

from robotd.log import get_logger

log = get_logger("ros")

PERIOD_S = 1.0


class OfferedTypes:
    """Looks at the publishers of a subscription once a second; one line of log per change.

    Args:
        node: owner of the subscription; the look runs in its executor.
        subscription: whose publishers are looked at.
        taken: the type's full name, ``geometry_msgs/msg/Twist``.
        advice: what the reader can do.
    """

    def __init__(self, node: Node, subscription: Subscription, taken: str, advice: str) -> None:
        self._node = node
        self._topic = subscription.topic_name
        self._taken = taken
        self._advice = advice
        self._others: frozenset[str] = frozenset()
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(PERIOD_S, self.look, clock=steady)

    def look(self) -> None:
        """Compare with what was there before. Executor thread."""
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
