"""Messages of the node ``robotd``: written by it from plain values, read by clients into them."""

from __future__ import annotations

from collections.abc import Mapping

from robotd_msgs.msg import AxisOwners, IoLevels

from robotd_ros.node_names import OPERATOR_NODE

OWNERS = f"{OPERATOR_NODE}/owners"
LEVELS = f"{OPERATOR_NODE}/io"
RECOVERY = f"{OPERATOR_NODE}/recovery"
REJECTIONS = f"{OPERATOR_NODE}/rejections"

Levels = Mapping[str, bool | None]  # by name; None: unknown

_CODES = {False: IoLevels.OFF, True: IoLevels.ON, None: IoLevels.UNKNOWN}
_LEVELS = {code: level for level, code in _CODES.items()}


def owners_message(owners: Mapping[str, str]) -> AxisOwners:
    """Return the message of the owners by axis."""
    return AxisOwners(axes=[*owners], owners=[*owners.values()])


def read_owners(message: AxisOwners) -> dict[str, str]:
    """Return the owners by axis; those that have none are missing."""
    return dict(zip(message.axes, message.owners, strict=True))


def levels_message(inputs: Levels, outputs: Levels) -> IoLevels:
    """Return the message of the levels of named inputs and outputs."""
    return IoLevels(
        inputs=[*inputs],
        input_levels=[_CODES[level] for level in inputs.values()],
        outputs=[*outputs],
        output_levels=[_CODES[level] for level in outputs.values()],
    )


def read_levels(message: IoLevels) -> tuple[dict[str, bool | None], dict[str, bool | None]]:
    """Return the levels of inputs and of outputs, by name."""
    inputs = zip(message.inputs, map(_LEVELS.get, message.input_levels), strict=True)
    outputs = zip(message.outputs, map(_LEVELS.get, message.output_levels), strict=True)
    return dict(inputs), dict(outputs)
