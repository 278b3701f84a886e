"""Names for authors of features, which run alongside a robot and observe it.

A feature, such as a page or a recorder, is a ``Feature`` in the entry-point group
``robotd.features``. It observes the robot through ``FeatureHost.tap``, the last seconds of its
frames, samples and events. It may command the robot as any program does: ``robotd.api.robots``.
``examples/csv_feature`` is a whole one.
"""

from typing import TYPE_CHECKING

from robotd.lazy_names import lazy_names

if TYPE_CHECKING:
    from robotd.descriptor.reduced_speed_settings import ReducedSpeedSettings
    from robotd.descriptor.section import File, Name, NotNegative, Positive, Section
    from robotd.descriptor.section import Problem as SectionProblem
    from robotd.device.camera_picture import CameraPictures
    from robotd.device.process_image import FLAGS, NUMBERS, VALUES, ProcessImage
    from robotd.events import OWN_PROCESS, Event, EventKind, Level, logged_command, sent_by
    from robotd.feature import Feature, FeatureOption, feature_failures, installed_features
    from robotd.feature_host import FeatureHost
    from robotd.folders import why_unwritable
    from robotd.guards import requested_guards
    from robotd.observation.frame_ring import (
        FrameMemory,
        FrameRing,
        Frames,
        frame_type,
        measured_joints,
    )
    from robotd.observation.io_sampler import (
        FIELDBUS,
        INPUTS,
        MAX_IO_BYTES,
        OBJECTS,
        OUTPUTS,
        IoSampler,
        Sample,
    )
    from robotd.observation.period_writer import period_writer
    from robotd.observation.robot_identity import identity
    from robotd.observation.tap import Tap
    from robotd.realtime import request_niceness
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "FIELDBUS",
    "FLAGS",
    "INPUTS",
    "MAX_IO_BYTES",
    "NUMBERS",
    "OBJECTS",
    "OUTPUTS",
    "OWN_PROCESS",
    "VALUES",
    "CameraPictures",
    "Event",
    "EventKind",
    "Feature",
    "FeatureHost",
    "FeatureOption",
    "File",
    "FrameMemory",
    "FrameRing",
    "Frames",
    "IoSampler",
    "Level",
    "Name",
    "NotNegative",
    "Positive",
    "ProcessImage",
    "ReducedSpeedSettings",
    "Sample",
    "Section",
    "SectionProblem",
    "Tap",
    "feature_failures",
    "frame_type",
    "identity",
    "installed_features",
    "logged_command",
    "measured_joints",
    "period_writer",
    "request_niceness",
    "requested_guards",
    "sent_by",
    "why_unwritable",
]
