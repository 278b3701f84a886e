"""Topics by which a robot's process feeds a page in another process."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from rclpy.qos import QoSProfile, ReliabilityPolicy

from robotd_messages.message_encoders import octets_message, read_octets_message
from robotd_page.page_message import Message
from robotd_ros.node_registry import OPERATOR_NODE

FIRST = f"{OPERATOR_NODE}/page/first"  # std_msgs/UInt8MultiArray: see ``pack_first``
SAMPLES = f"{OPERATOR_NODE}/page/samples"  # std_msgs/UInt8MultiArray: see ``LiveSamples``
CHANGES = f"{OPERATOR_NODE}/page/changes"  # std_msgs/String: state and events, as JSON

NEWEST = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
ALL = QoSProfile(depth=100)

_SEPARATOR = b"\0"  # JSON has none


def pack_first(messages: Sequence[Message]) -> bytes:
    """Return the first messages to a viewer as one message: the texts, then the samples."""
    texts = [message for message in messages if isinstance(message, str)]
    samples = b"".join(message for message in messages if isinstance(message, bytes))
    return octets_message(f"[{','.join(texts)}]".encode() + _SEPARATOR + samples)


def unpack_first(data: bytes) -> tuple[list[dict[str, Any]], bytes] | None:
    """Return texts and samples of ``pack_first``; None for an empty message.

    Raises ValueError for another message.
    """
    content = read_octets_message(data)
    if not content:
        return None
    texts, separator, samples = content.partition(_SEPARATOR)
    if not separator:
        raise ValueError("no first message of a page")
    return json.loads(texts), samples
