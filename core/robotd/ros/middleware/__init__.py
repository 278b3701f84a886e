"""Workarounds for rclpy and the DDS; the other modules of ``robotd.ros`` import from here only.

Each module states what it works around, its measurement, the upstream issue and the test or the
benchmark that shows what breaks without it.
"""

import robotd.ros.middleware.type_support  # noqa: F401 - before the first message
from robotd.ros.middleware.action_server import WorkerActionServer
from robotd.ros.middleware.cdr import HotPublisher
from robotd.ros.middleware.discovery import discovery_server, see_whole_graph
from robotd.ros.middleware.executor import EventsExecutor, destroy_node, spin_once, wake
from robotd.ros.middleware.exit_timer import exit_after
from robotd.ros.middleware.fastdds_profiles import use_profiles
from robotd.ros.middleware.message_info import with_message_info
from robotd.ros.middleware.participants import Participant
from robotd.ros.middleware.rate_limit import RateLimit
from robotd.ros.middleware.release_gil import request_id_of
from robotd.ros.middleware.service_responses import ServiceResponses
from robotd.ros.middleware.shared_memory import remove_leftovers
from robotd.ros.middleware.stamp_clock import StampClock
from robotd.ros.middleware.start_arguments import (
    check_overrides,
    check_remapping,
    overrides_of,
    remapped_action,
)
from robotd.ros.middleware.type_mismatch import TypeMismatchCheck

__all__ = [
    "EventsExecutor",
    "HotPublisher",
    "Participant",
    "RateLimit",
    "ServiceResponses",
    "StampClock",
    "TypeMismatchCheck",
    "WorkerActionServer",
    "check_overrides",
    "check_remapping",
    "destroy_node",
    "discovery_server",
    "exit_after",
    "overrides_of",
    "remapped_action",
    "remove_leftovers",
    "request_id_of",
    "see_whole_graph",
    "spin_once",
    "use_profiles",
    "wake",
    "with_message_info",
]
