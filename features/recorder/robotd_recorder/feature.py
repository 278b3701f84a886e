"""The recorder as a feature."""

from pydantic import Field

from robotd.api.commands import FOLDER
from robotd.api.features import Feature, FeatureOption, File, Section


class RecorderSettings(Section):
    """Flight recorder: the last seconds of everything, saved when something goes wrong."""

    enabled: bool = Field(True, description="False: no recording, and no memory for it.")
    seconds: float = Field(
        30.0, ge=5, le=600, description="Time before a fault, within 22 MiB of memory."
    )
    after_s: float = Field(2.0, ge=0, le=30, description="Time recorded after a fault.")
    folder: File | None = Field(
        None,
        description="Folder of the recordings; null: `robotd/recordings` in "
        "`$XDG_STATE_HOME`, which is `~/.local/state` by default.",
    )
    keep_files: int = Field(20, ge=1, le=10000, description="Recordings to keep, newest first.")
    keep_mib: float = Field(500.0, ge=10, description="Size of all recordings to keep, MiB.")
    split_mib: float = Field(
        1024.0, ge=1, description="Size at which a continuous recording begins a new file, MiB."
    )
    split_s: float = Field(
        3600.0, ge=1, description="Time after which a continuous recording begins a new file."
    )
    cameras: bool = Field(
        False,
        description="Continuous recordings have the pictures of the cameras of a simulated world,"
        " as JPEG at their rates.",
    )


class RecorderKeys(Section):
    """Keys at the top of the file."""

    recorder: RecorderSettings = Field(RecorderSettings(), description="Flight recorder of faults.")
    record: File | None = Field(
        None,
        description="Folder of a continuous recording of everything, as MCAP files; null: none.",
    )


FEATURE = Feature(
    summary="the last seconds of everything, saved after a fault, and continuous recordings",
    settings=RecorderKeys,
    open="robotd_recorder.recorder:open_recorder",
    nodes="robotd_recorder.recorder_services:add_services",
    options=(
        FeatureOption(
            "--record", "record", "Record everything there, as MCAP files.", "DIR", FOLDER
        ),
        FeatureOption(
            "--record-dir",
            "recorder.folder",
            "Folder of the flight recorder; short for --set recorder.folder=DIR.",
            "DIR",
            FOLDER,
        ),
    ),
)
