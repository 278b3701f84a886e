"""Model of the descriptor section ``backends.sim``; every key ends in its unit."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from robotd.api import BackendOptions, DescriptorError, FloatArray

IMAGE_BYTES = 8000  # of the inputs, and of the outputs
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Ratio = Annotated[float, Field(ge=0, le=1)]


class LimitSwitches(BaseModel):
    """Positions of the limit switches of an axis; None: no switch on that side."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    negative_rad: Finite | None = None
    positive_rad: Finite | None = None


class HomeSwitch(BaseModel):
    """The range of positions in which the home switch of an axis is closed."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    position_rad: Finite
    width_rad: Positive = 0.01


class SimOptions(BackendOptions):
    """Options of the simulation; a list is per axis, a number holds for all."""

    tick_s: float = Field(0.001, ge=0.000_25, le=0.01, description="Fieldbus cycle.")
    seed: int = Field(0, ge=0, description="Seed of the noise.")
    bandwidth_hz: Positive | tuple[Positive, ...] = Field(
        50.0,
        description="Position loop: the measured position lags as behind a first-order filter.",
    )
    feedforward: Ratio | tuple[Ratio, ...] = Field(
        0.9, description="Part of the commanded velocity that is fed forward to the loop."
    )
    inertia_kg_m2: NotNegative | tuple[NotNegative, ...] = Field(
        0.5, description="At the joint; gives the torque of an acceleration."
    )
    viscous_friction_nm_s: NotNegative | tuple[NotNegative, ...] = Field(
        1.0, description="Torque per rad/s."
    )
    coulomb_friction_nm: NotNegative | tuple[NotNegative, ...] = Field(
        2.0, description="Torque against the motion, whatever its speed."
    )
    coast_deceleration_rad_s2: Positive | tuple[Positive, ...] = Field(
        10.0, description="Deceleration by friction of an axis whose servo went off."
    )
    torque_noise_nm: NotNegative = Field(0.0, description="Standard deviation of the torque.")
    velocity_noise_rad_s: NotNegative = Field(0.0, description="The same of the velocity.")
    initial_position_rad: Finite | tuple[Finite, ...] | None = Field(
        None,
        description="Position of the axes at power-on, in m if prismatic; null: 0, or the nearest"
        " one inside the limits of the joint.",
    )
    encoder_counts_per_turn: int = Field(
        2**20, ge=256, le=2**31 - 1, description="Encoder, unless a parameter file defines it."
    )
    stream_timeout_s: Positive = Field(
        0.25, description="Without a new setpoint for this long, streaming axes stop by themselves."
    )
    limit_switches: dict[int, LimitSwitches] = Field({}, description="Axis to limit switches.")
    home_switches: dict[int, HomeSwitch] = Field({}, description="Axis to home switch.")
    initial_inputs: tuple[Annotated[int, Field(ge=0, le=255)], ...] = Field(
        (),
        max_length=IMAGE_BYTES,
        description="Bytes of the inputs at power-on, from byte 0: `[8]` is an input 0.3 that is"
        " on.",
    )
    io_loopback: bool = Field(False, description="Inputs show the outputs one cycle later.")
    io_module: bool | None = Field(
        None, description="An I/O module on the fieldbus; null: if the robot has a gripper."
    )
    fail_open: int = Field(0, ge=0, description="How many attempts to open shall fail.")
    open_delay_s: NotNegative = Field(0.0, description="Time to open the device.")
    communication_delay_s: NotNegative = Field(
        0.02, description="Time from the request to the first cyclic exchange."
    )
    hot_connect_delay_s: NotNegative = Field(0.2, description="Time to take slaves back in.")
    max_catch_up_s: Positive = Field(
        30.0, description="Longest time to catch up after a pause of all callers."
    )

    def per_axis(self, key: str, axes: int) -> FloatArray:
        """The option ``key`` as an array of shape (axes,). Raises DescriptorError."""
        value = np.asarray(getattr(self, key), dtype=np.float64)
        if value.ndim and value.shape != (axes,):
            message = f"has {value.size} figures, the robot has {axes} axes, 0 to {axes - 1}"
            raise DescriptorError(message, key=f"backends.sim.{key}")
        return np.broadcast_to(value, (axes,)).copy()

    def ticks(self, seconds: float) -> int:
        """Whole fieldbus cycles in ``seconds``, at least 1."""
        return max(1, math.ceil(seconds / self.tick_s - 1e-9))
