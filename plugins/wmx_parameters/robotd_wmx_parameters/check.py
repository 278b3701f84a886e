"""Check of a robot's WMX parameter file for ``robotd check``."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from robotd.api import RobotDescriptor
from robotd_wmx_parameters.advice import parameter_warnings
from robotd_wmx_parameters.xml_file import read_wmx_parameters


def check_parameters(
    robot: RobotDescriptor,
) -> Iterator[tuple[str, Callable[[], Iterable[str]]]]:
    """Yield the check of ``parameters_file``, where the robot has one."""
    file = robot.parameters_file
    if file is not None:
        yield f"parameters {file.name}", lambda: _warnings(file, robot)


def _warnings(file: Path, robot: RobotDescriptor) -> Iterable[str]:
    """Return what is unwise in the file. Raises DescriptorError: it is wrong."""
    found = read_wmx_parameters(file, robot.axes)
    missing = found.missing_summary(robot.axes)
    incomplete = [f"parameters {file.name}: {missing}"] if missing else []
    return [*incomplete, *parameter_warnings(found, robot)]
