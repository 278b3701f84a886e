"""The recorder as a feature."""

from robotd.cli.options import FOLDER
from robotd.feature import Feature, FeatureOption
from robotd_recorder.settings import RecorderKeys

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
