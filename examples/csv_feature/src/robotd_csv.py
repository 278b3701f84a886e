"""Feature of a third party: joint positions as CSV.

It has a section in the robot's file, an option of ``robotd run``, and a reader of the tap:

    csv: {file: positions.csv, rate_hz: 10}
    robotd --robot cr3a --backend sim --csv positions.csv
"""

import csv
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pydantic import Field

from robotd.api.features import VALUES, Feature, FeatureHost, FeatureOption, Section


class CsvSettings(Section):
    """Values of the section ``csv``."""

    file: Path | None = Field(None, strict=False, description="File; null: nothing is written.")
    rate_hz: float = Field(10.0, gt=0, le=100, description="Rows per second.")


class CsvKeys(Section):
    """Keys at the top of a robot's file."""

    csv: CsvSettings = Field(CsvSettings(), description="Joint positions as CSV.")


FEATURE = Feature(
    summary="joint positions as CSV",
    settings=CsvKeys,
    open="robotd_csv:open_csv",
    options=(FeatureOption("--csv", "csv.file", "Write joint positions to FILE.", "FILE"),),
)


@contextmanager
def open_csv(host: FeatureHost) -> Iterator[Path | None]:
    """Write a row of positions, rad or m, at ``rate_hz`` while the robot runs."""
    settings = host.robot.descriptor.settings(CsvKeys).csv
    if settings.file is None:
        yield None
        return
    tap, axes = host.tap(), list(host.robot.joint_axes)
    due_ns, step_ns = 0, round(1e9 / settings.rate_hz)
    cursor = 0
    with settings.file.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(["time_s", *host.robot.joint_names])

        def write() -> None:
            """Called by the thread of the tap ten times a second."""
            nonlocal due_ns, cursor
            frames, cursor, _ = tap.frames.since(cursor)
            positions = frames["values"][:, VALUES.index("position")]
            for start_ns, position in zip(frames["start_ns"], positions, strict=True):
                if start_ns >= due_ns:
                    due_ns = start_ns + step_ns
                    writer.writerow([start_ns * 1e-9, *position[axes].tolist()])
            stream.flush()

        tap.add_reader(write)
        yield settings.file
