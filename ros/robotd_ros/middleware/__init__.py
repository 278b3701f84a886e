"""Workarounds for rclpy and the DDS; the other modules of ``robotd_ros`` import from here only.

Each module states what it works around, its measurement, the upstream issue, the version that ends
it, and the test or the benchmark that shows what breaks without it. A client needs few:
they are imported when they are used.
"""

from typing import TYPE_CHECKING

import robotd_ros.middleware.type_support  # noqa: F401 - before the first message
from robotd.lazy_names import lazy_names

if TYPE_CHECKING:
    from robotd_ros.middleware.action_server import release_request, worker_action_server
    from robotd_ros.middleware.cdr import HotPublisher
    from robotd_ros.middleware.executor import (
        EventsExecutor,
        add_node,
        destroy_node,
        spin_once,
        wake,
    )
    from robotd_ros.middleware.exit_timer import exit_after, exit_where_it_hangs
    from robotd_ros.middleware.fastdds_profiles import (
        discovery_server,
        see_whole_graph,
        use_profiles,
    )
    from robotd_ros.middleware.log_files import log_file_arguments
    from robotd_ros.middleware.message_info import with_message_info
    from robotd_ros.middleware.participants import Participant
    from robotd_ros.middleware.rate_limit import NewestItems, RateLimit
    from robotd_ros.middleware.rcl_error import NODE_GONE, RCLError
    from robotd_ros.middleware.release_gil import request_id_of
    from robotd_ros.middleware.service_responses import PREFIX_BYTES, ServiceResponses
    from robotd_ros.middleware.shared_memory import remove_leftovers
    from robotd_ros.middleware.stamp_clock import StampClock
    from robotd_ros.middleware.start_arguments import (
        check_overrides,
        check_remapping,
        overrides_of,
    )
    from robotd_ros.middleware.type_mismatch import TypeMismatchCheck
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "NODE_GONE",
    "PREFIX_BYTES",
    "EventsExecutor",
    "HotPublisher",
    "NewestItems",
    "Participant",
    "RCLError",
    "RateLimit",
    "ServiceResponses",
    "StampClock",
    "TypeMismatchCheck",
    "add_node",
    "check_overrides",
    "check_remapping",
    "destroy_node",
    "discovery_server",
    "exit_after",
    "exit_where_it_hangs",
    "log_file_arguments",
    "overrides_of",
    "release_request",
    "remove_leftovers",
    "request_id_of",
    "see_whole_graph",
    "spin_once",
    "use_profiles",
    "wake",
    "with_message_info",
    "worker_action_server",
]
