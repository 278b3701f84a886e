"""rclpy's action client, for threads other than the executor's."""

from __future__ import annotations

import threading
from typing import Any

from rclpy.action import ActionClient


class GoalClient(ActionClient):
    """An action client that loses no answer.

    rclpy's sends a request and then notes that it waits for the answer; one that is quicker, while
    the sending thread is not running, is ignored as unexpected. Here the executor waits until it
    is recorded, as it does in rclpy's client of services.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        self._noting = threading.RLock()
        super().__init__(*args, **kwargs)

    def send_goal_async(self, *args: Any, **kwargs: Any) -> Any:
        with self._noting:
            return super().send_goal_async(*args, **kwargs)

    def _get_result_async(self, goal_handle: Any) -> Any:
        with self._noting:
            return super()._get_result_async(goal_handle)

    def _cancel_goal_async(self, goal_handle: Any) -> Any:
        with self._noting:
            return super()._cancel_goal_async(goal_handle)

    async def execute(self, taken_data: Any) -> None:
        with self._noting:
            pass
        await super().execute(taken_data)
