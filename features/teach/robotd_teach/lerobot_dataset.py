"""Episodes of a LeRobot dataset, version 3.0, in a folder: read, and written anew.

Its format is files of JSON and Parquet: one row of a data file for each frame, one of
``meta/episodes`` for each episode. LeRobot itself, which brings PyTorch, is not needed.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from robotd.api import DescriptorError, FloatArray, InvalidArgument, RecordingError, read_limited
from robotd_teach.joint_motion_file import FileMotion

VERSION = "v3.0"
STATE, ACTION = "observation.state", "action"
SUFFIX = ".pos"  # of a joint's name in a feature
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
EPISODES = "meta/episodes/chunk-000/file-000.parquet"
QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
MAX_BYTES = 4_000_000  # of a JSON file
TICKS_PER_TURN = 4096  # of the servos that LeRobot's calibration files describe
OWN_TYPE = "robotd"  # robot type of datasets that LeRobot records of a robot of robotd
PANDAS = {  # tasks are the index of a data frame
    "index_columns": ["task"],
    "column_indexes": [],
    "columns": [
        {
            "name": name,
            "field_name": name,
            "pandas_type": kind,
            "numpy_type": numpy_type,
            "metadata": None,
        }
        for name, kind, numpy_type in (
            ("task_index", "int64", "int64"),
            ("task", "unicode", "object"),
        )
    ],
}


class AngleUnit(Enum):
    """Unit of the positions in a dataset, which its files do not have.

    Attributes:
        RAD: rad, or m of a prismatic joint: datasets of a robot of robotd.
        DEG: degrees, 0 in the middle of the joint's calibrated range.
        PERCENT: -100 to 100 over that range; it needs the calibration file.
    """

    RAD = "rad"
    DEG = "deg"
    PERCENT = "percent"


def read_episode(
    folder: Path,
    episode: int,
    robot: str,
    joints: Sequence[str],
    unit: AngleUnit | None = None,
    calibration: Path | None = None,
    feature: str = STATE,
) -> FileMotion:
    """Return the positions of joints in an episode. Any thread.

    Args:
        folder: of the dataset, on this computer.
        episode: its index, from 0.
        robot: name of the robot; datasets of it are in rad where ``unit`` is None.
        joints: in the order of the positions; the feature names each, or each with ``.pos``.
        unit: of the positions; None: rad for a dataset of a robot of robotd, else an error.
        calibration: LeRobot's calibration file of the arm, for percentages.
        feature: ``observation.state``, what was measured, or ``action``.

    Raises:
        RecordingError: no such dataset, of another version, or damaged; pyarrow is missing.
        InvalidArgument: no such episode, feature or joint, or the unit is not known.
        DescriptorError: the calibration file is wrong.
    """
    source, info = f"{folder}#{episode}", _info(folder)
    columns = _columns(source, info, feature, joints)
    scale = _scale(source, info, robot, joints, unit, calibration)
    chunk, file, index = "data/chunk_index", "data/file_index", "episode_index"
    places = _rows(folder, "meta/episodes", [index, chunk, file])
    if episode not in places[index]:
        known = f"0 to {max(places[index])}" if places[index] else "none"
        raise InvalidArgument(f"{folder}: no episode {episode} (available: {known})")
    row = places[index].index(episode)
    data = DATA_PATH.format(chunk_index=places[chunk][row], file_index=places[file][row])
    rows = _rows(folder, data, ["timestamp", feature], filters=[(index, "==", episode)])
    values = np.array(rows[feature], np.float64).reshape(len(rows["timestamp"]), -1)
    positions = values[:, columns] * scale
    if not np.isfinite(positions).all():
        raise RecordingError(f"{source}: a position of {feature} is not a finite number")
    return FileMotion(source, np.array(rows["timestamp"], np.float64), positions)


def _rows(folder: Path, name: str, columns: list[str], **options: Any) -> dict[str, list[Any]]:
    """Return columns of a Parquet file, or of those in a folder. Raises RecordingError."""
    parquet = _parquet()
    try:
        rows = parquet.read_table(folder / name, columns=columns, **options).to_pydict()
        return {column: rows[column] for column in columns}
    except (OSError, ValueError, KeyError) as error:
        raise RecordingError(f"{folder / name}: not a file of a dataset: {error}") from error


def _parquet() -> Any:
    """Return the module that reads and writes Parquet. Raises RecordingError: missing."""
    try:
        import pyarrow.parquet
    except ImportError as error:
        text = "a LeRobot dataset needs pyarrow: pip install --editable '.[lerobot]'"
        raise RecordingError(text) from error
    return pyarrow.parquet


def _info(folder: Path) -> Mapping[str, Any]:
    """Return ``meta/info.json``. Raises RecordingError."""
    try:
        info = json.loads(read_limited(folder / "meta" / "info.json", MAX_BYTES))
        version = info["codebase_version"]
    except (DescriptorError, ValueError, KeyError, TypeError) as error:
        raise RecordingError(f"{folder}: not a LeRobot dataset: {error}") from error
    if version != VERSION:
        text = f"{folder}: a LeRobot dataset of version {version}, must be {VERSION}"
        raise RecordingError(f"{text}: LeRobot converts it")
    return dict(info)


def _columns(
    source: str, info: Mapping[str, Any], feature: str, joints: Sequence[str]
) -> list[int]:
    """Return the column of each joint in a feature. Raises InvalidArgument."""
    features = info.get("features", {})
    if feature not in features:
        known = ", ".join(features)
        raise InvalidArgument(f"{source}: no feature {feature!r} (available: {known})")
    names = features[feature].get("names") or []
    if isinstance(names, dict):  # a list by the name of its kind, in datasets of others
        names = [name for part in names.values() for name in part]
    columns = [str(name).removesuffix(SUFFIX) for name in names]
    if missing := [joint for joint in joints if joint not in columns]:
        text = f"{feature} has no joint {', '.join(missing)}"
        raise InvalidArgument(f"{source}: {text} (available: {', '.join(columns) or 'none'})")
    return [columns.index(joint) for joint in joints]


def _scale(
    source: str,
    info: Mapping[str, Any],
    robot: str,
    joints: Sequence[str],
    unit: AngleUnit | None,
    calibration: Path | None,
) -> FloatArray:
    """Return rad or m of 1 in the dataset, (n,). Raises InvalidArgument, DescriptorError."""
    if unit is None:
        kind = info.get("robot_type")
        if kind not in {OWN_TYPE, robot}:
            text = f"the files do not say which unit the positions of {kind} have"
            raise InvalidArgument(f"{source}: {text}: name rad, deg or percent")
        unit = AngleUnit.RAD
    if (calibration is not None) != (unit is AngleUnit.PERCENT):
        raise InvalidArgument("a calibration file belongs to percent, which needs one")
    if calibration is None:
        return np.full(len(joints), 1.0 if unit is AngleUnit.RAD else math.radians(1.0))
    try:
        ranges = json.loads(read_limited(calibration, MAX_BYTES))
        ticks = [
            (ranges[joint]["range_max"] - ranges[joint]["range_min"])
            * (-1 if ranges[joint].get("drive_mode") else 1)
            for joint in joints
        ]
        return np.array(ticks, np.float64) / 200.0 * (2.0 * math.pi / TICKS_PER_TURN)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        text = f"is not a calibration file of LeRobot for these joints: {error}"
        raise DescriptorError(text, path=calibration) from error


def write_dataset(
    folder: Path,
    robot: str,
    joints: Sequence[str],
    positions: FloatArray,
    rate_hz: int,
    task: str,
) -> None:
    """Write a dataset of one episode, as LeRobot records it of a robot of robotd.

    ``observation.state`` and ``action`` are the same positions.

    Args:
        folder: must not exist.
        positions: (k, n), rad or m, one row each ``1 / rate_hz``.
        task: what is done, in words.

    Raises:
        RecordingError: pyarrow is missing.
        OSError: the folder cannot be written.
    """
    parquet = _parquet()
    from pyarrow import array, field, float32, int64, list_, schema, string, table

    count, width = positions.shape
    names = [f"{joint}{SUFFIX}" for joint in joints]
    frames = np.arange(count)
    columns = {
        "timestamp": (float32(), frames / rate_hz),
        **{name: (int64(), frames) for name in ("frame_index", "index")},
        **{name: (int64(), np.zeros(count, int)) for name in ("episode_index", "task_index")},
    }
    vector = list_(float32(), width)
    rows = array(positions.astype(np.float32).tolist(), vector)
    data = table(
        {
            ACTION: rows,
            STATE: rows,
            **{name: array(values, kind) for name, (kind, values) in columns.items()},
        }
    )
    features = {
        name: {"dtype": "float32", "shape": [width], "names": names} for name in (ACTION, STATE)
    } | {
        name: {"dtype": str(kind).replace("float", "float32"), "shape": [1], "names": None}
        for name, (kind, _) in columns.items()
    }
    stats = {name: _stats(values[:, None]) for name, (_, values) in columns.items()}
    stats |= dict.fromkeys((ACTION, STATE), _stats(positions))
    episode = {
        "episode_index": 0,
        "tasks": [task],
        "length": count,
        "data/chunk_index": 0,
        "data/file_index": 0,
        "dataset_from_index": 0,
        "dataset_to_index": count,
        **{f"stats/{name}/{key}": found[key] for name, found in stats.items() for key in found},
        "meta/episodes/chunk_index": 0,
        "meta/episodes/file_index": 0,
    }
    info = {
        "codebase_version": VERSION,
        "robot_type": robot,
        "total_episodes": 1,
        "total_frames": count,
        "total_tasks": 1,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": rate_hz,
        "splits": {"train": "0:1"},
        "data_path": DATA_PATH,
        "video_path": None,
        "features": features,
    }
    of_tasks = schema(
        [field("task_index", int64()), field("task", string())],
        metadata={"pandas": json.dumps(PANDAS)},
    )
    tasks = table({"task_index": [0], "task": [task]}, schema=of_tasks)
    # Under its name when it is whole.
    part = folder.with_name(f"{folder.name}.part")
    for name, content in (
        (DATA_PATH.format(chunk_index=0, file_index=0), data),
        (EPISODES, table({name: [value] for name, value in episode.items()})),
        ("meta/tasks.parquet", tasks),
    ):
        (part / name).parent.mkdir(parents=True, exist_ok=True)
        parquet.write_table(content, part / name)
    for name, found in (("info", info), ("stats", stats)):
        (part / "meta" / f"{name}.json").write_text(json.dumps(found, indent=4), encoding="utf-8")
    part.rename(folder)


def _stats(values: FloatArray) -> dict[str, list[float]]:
    """Return LeRobot's statistics of values (k, n)."""
    found = {
        "min": values.min(axis=0),
        "max": values.max(axis=0),
        "mean": values.mean(axis=0),
        "std": values.std(axis=0),
        "count": np.array([len(values)]),
        **{name: np.quantile(values, part, axis=0) for name, part in QUANTILES.items()},
    }
    return {name: value.tolist() for name, value in found.items()}
