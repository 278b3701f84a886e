"""Subscription callbacks that get a message and its information, with any executor.

Works around: rclpy calls a callback of two arguments with the message and a dictionary; its
EventsExecutor calls it with one tuple of both, which a function of two arguments cannot take
("SystemError: null argument to internal routine", and the message is lost).
Measured: nothing; rclpy makes the dictionary for every message anyway.
Upstream: none known; https://github.com/ros2/rclpy/pull/922 added such callbacks.
Ends with: no version yet; both ways of the call are taken.
Shown by: tests/ros/test_middleware.py.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any


def with_message_info(
    callback: Callable[[Any, Mapping[str, Any]], None],
) -> Callable[..., None]:
    """Return a callback for ``Node.create_subscription`` that calls ``callback(message, info)``."""

    def on_message(*arguments: Any) -> None:
        message, info = arguments[0] if len(arguments) == 1 else arguments
        callback(message, info)

    # rclpy counts the arguments by the signature.
    on_message.__signature__ = inspect.signature(callback)  # type: ignore[attr-defined]
    return on_message
