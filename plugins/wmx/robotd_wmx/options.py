"""Options under ``backends.wmx`` of a robot descriptor."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from robotd.api import BackendOptions

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class WmxOptions(BackendOptions):
    """Options of the WMX engine."""

    sdk_path: str = Field(
        "", description="Root of the SDK; empty: the one that the binding was built against."
    )
    shared: bool = Field(
        False,
        description="The engine belongs to another program: its communication is waited for,"
        " never started or stopped, and its parameters are left alone.",
    )
    engine_timeout_s: Positive = Field(10.0, description="Time for the engine to start or stop.")
    lock_timeout_s: Positive = Field(
        5.0, description="How long to try again while another process locks the engine."
    )
    watchdog_s: Annotated[float, Field(ge=0, le=60)] = Field(
        1.0, description="The engine closes our devices so long after this process died; 0: never."
    )
    masters: int = Field(1, ge=1, le=2, description="EtherCAT masters of the engine.")
    spline_channel: int = Field(
        0, ge=0, lt=128, description="Spline channel; programs on one engine need different ones."
    )
    stream_positions: bool = Field(
        True,
        description="Stream position setpoints through the engine's cyclic buffers, where the SDK"
        " has them; false: trajectories run as splines on the engine.",
    )
    stream_buffer_s: Annotated[float, Field(ge=0.002, le=0.1)] = Field(
        0.01,
        description="Setpoints held ahead in the cyclic buffers: the command is so much later, and"
        " a delay of the control loop by as much does not reach the axes.",
    )
    units_per_si: Positive | tuple[Positive, ...] = Field(
        1.0,
        description="User units of the engine per rad or m, for all axes or one figure each;"
        " 1 where the gear ratio of the parameter file makes the user unit a radian.",
    )
    stop_deceleration_rad_s2: Positive = Field(
        10.0, description="Controlled stop of an axis for which the robot gives no acceleration."
    )
