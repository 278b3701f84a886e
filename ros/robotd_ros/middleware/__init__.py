"""Workarounds for rclpy and the DDS; the other modules of ``robotd_ros`` import from here only.

Each module states what it works around, its measurement, the upstream issue and the test or the
benchmark that shows what breaks without it.
"""

import robotd_ros.middleware.type_support  # noqa: F401 - before the first message
from robotd_ros.middleware.action_server import worker_action_server
from robotd_ros.middleware.cdr import HotPublisher
from robotd_ros.middleware.executor import EventsExecutor, destroy_node, spin_once, wake
from robotd_ros.middleware.exit_timer import exit_after, exit_where_it_hangs
from robotd_ros.middleware.fastdds_profiles import discovery_server, see_whole_graph, use_profiles
from robotd_ros.middleware.log_files import log_file_arguments
from robotd_ros.middleware.message_info import with_message_info
from robotd_ros.middleware.participants import Participant
from robotd_ros.middleware.rate_limit import RateLimit
from robotd_ros.middleware.rcl_error import NODE_GONE, RCLError
from robotd_ros.middleware.release_gil import request_id_of
from robotd_ros.middleware.service_responses import ServiceResponses
from robotd_ros.middleware.shared_memory import remove_leftovers
from robotd_ros.middleware.stamp_clock import StampClock
from robotd_ros.middleware.start_arguments import (
    check_overrides,
    check_remapping,
    overrides_of,
)
from robotd_ros.middleware.type_mismatch import TypeMismatchCheck

__all__ = [
    "NODE_GONE",
    "EventsExecutor",
    "HotPublisher",
    "Participant",
    "RCLError",
    "RateLimit",
    "ServiceResponses",
    "StampClock",
    "TypeMismatchCheck",
    "check_overrides",
    "check_remapping",
    "destroy_node",
    "discovery_server",
    "exit_after",
    "exit_where_it_hangs",
    "log_file_arguments",
    "overrides_of",
    "remove_leftovers",
    "request_id_of",
    "see_whole_graph",
    "spin_once",
    "use_profiles",
    "wake",
    "with_message_info",
    "worker_action_server",
]
