"""Process image of all axes, in SI units."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robotd.api import ProcessImage
from robotd_canopen.axis import Axis
from robotd_canopen.feedback import TORQUE, VELOCITY, Feedback


def fill_image(image: ProcessImage, axes: Sequence[Axis], feedback: Feedback) -> None:
    """Control loop: measured values of axes that answer, and the state of all; not ``fresh_ns``."""
    feedback.unwrap()
    for axis in axes:
        axis.observe(image)
    units = np.array(
        [(axis.scaling.position, axis.scaling.velocity, axis.scaling.torque) for axis in axes]
    )
    live = ~image.offline
    np.multiply(feedback.counts, units[:, 0], out=image.position, where=live)
    np.multiply(feedback.columns[VELOCITY], units[:, 1], out=image.velocity, where=live)
    np.multiply(feedback.columns[TORQUE], units[:, 2], out=image.torque, where=live)
