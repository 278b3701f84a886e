"""Habits of real drives, as settings of the independent CiA 402 drive."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass
class Knobs:
    """Habits of real drives; counts are those of the encoder. Most can change at run time."""

    power_on_position: int = 123_456
    max_speed: float = 655_360.0  # counts/s
    lag_s: float = 0.005
    step_s: float = 1e-3  # of its time
    encoder: int = 65_536  # counts per turn
    feed: int = 65_536  # position units per turn
    position_bits: int = 32  # of actual, demand and target position, which wrap with them
    link_mass_kg: float = 0.0  # at the end of a link, level at position 0; 0: no link
    link_length_m: float = 0.3
    link_counts_per_rad: float = 65_536 / math.tau
    rated_torque_nm: float = 20.0  # 0x6076
    external_torque_nm: float = 0.0  # on the link, as of a hand
    supported_modes: int = 0x3A5  # 0x6502
    brake_release_s: float = 0.0  # from "operation enabled" on it ignores set-points: bit 12 is 0
    brake_close_s: float = 0.0  # until it holds; only "disable voltage" takes the torque before
    fall: float = 0.0  # counts/s² of an axis without torque and brake
    following_bit: bool = True  # bit 12 of the cyclic modes; False: it is always 0
    negative_limit: float = -math.inf  # switch that is closed here and below, counts
    positive_limit: float = math.inf
    homing_error_s: float = math.inf  # from the start of a homing to a homing error
    homing_error_moves: bool = False  # it goes on after that, until a quick stop or a halt
    sdo_delay_s: float = 0.0
    sdo_missing: int = 0  # number of SDO responses that do not come; -1 for all
    sdo_mute: tuple[int, ...] = ()  # indexes whose responses never come
    store_s: float = 0.0  # delay of the response to 0x1010
    duplicate_delay_s: float = 0.0  # a second node with this id answers after this time
    rejected: tuple[int, ...] = ()  # indexes that cannot be written
    rejection: str = "ro"  # read-only in the EDS too; "abort": only when they are written
    absent: tuple[int, ...] = ()  # indexes that do not exist
    event_position: bool = False  # its TPDO has no event timer and is not sent without a change
    unmapped: tuple[int, ...] = ()  # indexes that no PDO can hold
    mode_delay_s: float = 0.0  # from 0x6060 to the change of the mode, and to its display
    missing_bytes: int = 0  # at the end of each TPDO
    fixed_mapping: bool = False  # mapping objects are constant
    position_alone: bool = False  # the default mapping has the position in a TPDO of its own
    self_starting: bool = False  # operational without an NMT command, TPDOs active by default
    heartbeat_ms: int = 0  # default of 0x1017
    heartbeat_copies: int = 1
    boot_s: float = 0.05
    status_delay_s: float = 0.0
    code_in_603f: bool = True
    empty_strings: bool = False
    deaf: bool = False  # no frame reaches it
    mute: bool = False  # none of its frames reaches the bus
