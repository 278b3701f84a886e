"""Paths from recordings and LeRobot datasets, and back. Needs no running robot."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from robotd.api import (
    FloatArray,
    InvalidArgument,
    OperationError,
    RobotDescriptor,
    unknown_name,
)
from robotd.api.robots import JointLimits, axis_limits, joint_limits
from robotd_shared.pose_file import check_name
from robotd_teach.joint_motion_file import FileMotion
from robotd_teach.joint_state_file import write_joint_states
from robotd_teach.lerobot_dataset import write_dataset
from robotd_teach.path_curve import interpolated
from robotd_teach.path_file import (
    SUFFIX,
    PathFile,
    folder_of,
    paths_in,
    read_path,
    require_free,
    write_path,
)
from robotd_teach.paths import kept_path

MCAP = ".mcap"
MCAP_RATE_HZ = 100
DATASET_RATE_HZ = 30


def limits_of(descriptor: RobotDescriptor, group: str = "") -> JointLimits:
    """Return the limits of a joint group; "": the only one. Raises InvalidArgument."""
    groups = {name: joints for name, joints in descriptor.joint_groups.items() if joints}
    if not groups:
        raise InvalidArgument(f"{descriptor.name} has no joints")
    if not group and len(groups) > 1:
        raise InvalidArgument(f"name one of the joint groups {', '.join(groups)}")
    if group and group not in groups:
        raise InvalidArgument(unknown_name("joint group", group, groups))
    joints = groups[group] if group else next(iter(groups.values()))
    return joint_limits(joints, axis_limits(descriptor))


def save_motion(
    descriptor: RobotDescriptor,
    name: str,
    motion: FileMotion,
    limits: JointLimits,
    *,
    replace: bool = False,
) -> str:
    """Save the motion of a file as a path, and return a text about it. Any worker thread.

    It becomes the same curve as a path that is recorded: noise is averaged, standing still at both
    ends is left out. A running robot has it at once.

    Args:
        descriptor: the robot of the path.
        name: of the path.
        motion: positions of the joints of ``limits``.
        limits: see ``limits_of``.
        replace: a path of this name is replaced.

    Raises:
        InvalidArgument: no name, the name is taken, the joints do not move or leave their limits,
            they moved while no position was written, or it is too long.
        OperationError: the file cannot be written.
    """
    check_name(name, "path")
    folder = folder_of(descriptor)
    require_free(folder, name, replace=replace)
    motion.require_path(limits)
    path, told = kept_path(descriptor.name, limits, motion.times_s, motion.positions)
    file = folder / f"{name}{SUFFIX}"
    with _writing(file):
        write_path(file, path)
    return f"{name}: {told}"


def export_path(
    descriptor: RobotDescriptor, name: str, target: Path, rate_hz: int = 0, task: str = ""
) -> str:
    """Write a path as joint states or as a LeRobot dataset, and return a text about it.

    Any worker thread.

    Args:
        descriptor: the robot of the path.
        name: of the path.
        target: a new file ``.mcap``, or else the new folder of a dataset.
        rate_hz: of the positions; 0: 100 in a file, 30 in a dataset.
        task: of the episode; "": the name of the path.

    Raises:
        InvalidArgument: unknown path, or the target exists.
        DescriptorError: the file of the path is wrong.
        RecordingError: a dataset needs pyarrow, which is missing.
        OperationError: the target cannot be written.
    """
    files = paths_in(folder_of(descriptor))
    if name not in files:
        raise InvalidArgument(unknown_name("path", name, files))
    path = read_path(files[name])
    is_file = target.suffix == MCAP
    rate_hz = rate_hz or (MCAP_RATE_HZ if is_file else DATASET_RATE_HZ)
    times_s, positions = _even(path, rate_hz)
    if target.exists():
        raise InvalidArgument(f"{target} exists already: name a new file or folder")
    with _writing(target):
        if is_file:
            write_joint_states(target, path.joints, times_s, positions)
        else:
            write_dataset(target, descriptor.name, path.joints, positions, rate_hz, task or name)
    unit = "messages" if is_file else "frames"
    return f"{target}: {name}, {path.duration_s:.1f} s, {len(times_s)} {unit} at {rate_hz} Hz"


@contextmanager
def _writing(target: Path) -> Iterator[None]:
    """Raise OperationError for an OSError of the block."""
    try:
        yield
    except OSError as error:
        raise OperationError(f"{target} cannot be written: {error.strerror or error}") from error


def _even(path: PathFile, rate_hz: int) -> tuple[FloatArray, FloatArray]:
    """Return times (k,), evenly apart, and positions (k, n) of a path to its end."""
    count = int(np.ceil(path.duration_s * rate_hz - 1e-6)) + 1
    times_s = np.arange(count) / rate_hz
    inner_s = np.minimum(times_s, path.duration_s)
    return times_s, interpolated(path.times_s, path.positions(path.joints), inner_s)
