"""Targets of exports; imported by the command, not by a robot that is being served."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from robotd_export.export_input import ExportInput
from robotd_export.isaac import topic_map
from robotd_export.moveit import move_group_parameters
from robotd_export.nav2 import navigation_parameters

EXPORTS: Mapping[str, Callable[[ExportInput], str]] = {
    "moveit": move_group_parameters,
    "nav2": navigation_parameters,
    "isaac": topic_map,
    "urdf": ExportInput.urdf,
}
"""Export functions by target. Each raises DescriptorError where it does not apply."""
