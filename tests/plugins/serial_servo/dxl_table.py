"""Control tables of simulated Dynamixel X servos, from the maker's e-manual."""

from __future__ import annotations

from dataclasses import dataclass, field

from tests.plugins.serial_servo.motor import MotorData
from tests.plugins.serial_servo.registers import Register


@dataclass(frozen=True, slots=True)
class Model:
    """One model: number, motor, registers that differ, and blocks of indirect addresses.

    indirect: (first address register, first data byte, count) of each block. current_ma: unit of
    currents, mA; None: no current sensor, no modes 0 and 5.
    """

    number: int
    motor: MotorData
    current_ma: float | None
    indirect: tuple[tuple[int, int, int], ...]
    defaults: dict[str, int] = field(default_factory=dict)


TWO_BLOCKS = ((168, 224, 28), (578, 634, 28))

MODELS = {
    "xl430-w250": Model(
        1060,
        MotorData(stall_nm=1.5, no_load_rad_s=6.4, stiffness_nm_rad=8, lag_s=0.02, stall_a=1.4),
        None,
        TWO_BLOCKS,
    ),
    "xm430-w350": Model(
        1020,
        MotorData(stall_nm=4.1, no_load_rad_s=4.8, stiffness_nm_rad=25, lag_s=0.02, stall_a=2.3),
        2.69,
        TWO_BLOCKS,
        {
            "temperature_limit": 80,
            "max_voltage": 160,
            "min_voltage": 95,
            "current_limit": 1193,
            "velocity_limit": 350,
            "velocity_i": 1920,
            "position_d": 0,
            "position_p": 800,
        },
    ),
    "xl330-m288": Model(
        1200,
        MotorData(0.52, 10.8, 3, 0.015, 1.47, 5.0, free_nm_s_rad=0.2),
        1.0,
        ((168, 208, 20),),
        {
            "temperature_limit": 70,
            "max_voltage": 70,
            "min_voltage": 35,
            "current_limit": 1750,
            "velocity_limit": 445,
            "velocity_i": 1600,
            "velocity_p": 180,
            "position_d": 0,
            "position_p": 400,
            "shutdown": 53,
        },
    ),
}
MODELS["xl330-m077"] = Model(
    1190,
    MotorData(0.228, 40.0, 0.7, 0.008, 1.47, 5.0, free_nm_s_rad=0.05),
    1.0,
    ((168, 208, 20),),
    {**MODELS["xl330-m288"].defaults, "velocity_limit": 1620},
)

# name, address, size, default, lowest, highest (None: any); the first part is EEPROM
EEPROM = (
    ("id", 7, 1, 1, 0, 252),
    ("baud", 8, 1, 1, 0, 7),
    ("return_delay", 9, 1, 250, 0, 254),
    ("drive_mode", 10, 1, 0, 0, 13),
    ("mode", 11, 1, 3, 0, 16),
    ("secondary_id", 12, 1, 255, 0, 255),
    ("protocol", 13, 1, 2, 1, 22),
    ("homing_offset", 20, 4, 0, -1_044_479, 1_044_479),
    ("moving_threshold", 24, 4, 10, 0, 1023),
    ("temperature_limit", 31, 1, 72, 0, 100),
    ("max_voltage", 32, 2, 140, 31, 160),
    ("min_voltage", 34, 2, 60, 31, 160),
    ("pwm_limit", 36, 2, 885, 0, 885),
    ("velocity_limit", 44, 4, 265, 0, 2047),
    ("max_position", 48, 4, 4095, 0, 4095),
    ("min_position", 52, 4, 0, 0, 4095),
    ("startup", 60, 1, 0, 0, 3),
    ("shutdown", 63, 1, 52, None, None),
)
RAM = (
    ("torque", 64, 1, 0, 0, 1),
    ("led", 65, 1, 0, 0, 1),
    ("return_level", 68, 1, 2, 0, 2),
    ("velocity_i", 76, 2, 1000, 0, 16_383),
    ("velocity_p", 78, 2, 100, 0, 16_383),
    ("position_d", 80, 2, 4000, 0, 16_383),
    ("position_i", 82, 2, 0, 0, 16_383),
    ("position_p", 84, 2, 640, 0, 16_383),
    ("feedforward_2", 88, 2, 0, 0, 16_383),
    ("feedforward_1", 90, 2, 0, 0, 16_383),
    ("bus_watchdog", 98, 1, 0, 0, 127),
    ("goal_pwm", 100, 2, 885, None, None),
    ("goal_velocity", 104, 4, 0, None, None),
    ("profile_acceleration", 108, 4, 0, 0, 32_767),
    ("profile_velocity", 112, 4, 0, 0, 32_767),
    ("goal_position", 116, 4, 0, None, None),
)
READ_ONLY = (
    ("registered", 69, 1),
    ("hardware_error", 70, 1),
    ("tick", 120, 2),
    ("moving", 122, 1),
    ("moving_status", 123, 1),
    ("pwm", 124, 2),
    ("load", 126, 2),
    ("velocity", 128, 4),
    ("position", 132, 4),
    ("velocity_trajectory", 136, 4),
    ("position_trajectory", 140, 4),
    ("voltage", 144, 2),
    ("temperature", 146, 1),
    ("backup_ready", 147, 1),
)
UNSIGNED = {"id", "baud", "return_delay", "secondary_id", "shutdown", "tick", "temperature"}


def control_table(model: Model) -> list[Register]:
    """Return the registers of a model. ``load`` at 126 is a current where there is a sensor."""

    def register(
        persistent: bool, row: tuple[str, int, int, int, int | None, int | None]
    ) -> Register:
        name, address, size, default, lowest, highest = row
        return Register(
            address,
            size,
            name,
            model.defaults.get(name, default),
            persistent,
            signed=name not in UNSIGNED,
            lowest=lowest,
            highest=highest,
        )

    table = [register(True, row) for row in EEPROM] + [register(False, row) for row in RAM]
    if model.current_ma is not None:
        limit = model.defaults["current_limit"]
        table.append(register(True, ("current_limit", 38, 2, limit, 0, limit)))
        table.append(register(False, ("goal_current", 102, 2, limit, None, None)))
    table += [
        Register(address, size, name, writable=False, signed=name not in UNSIGNED)
        for name, address, size in READ_ONLY
    ]
    table.append(Register(0, 2, "model", model.number, persistent=True, writable=False))
    table.append(Register(6, 1, "firmware", 46, persistent=True, writable=False))
    number = 1
    for addresses, data, count in model.indirect:
        for index in range(count):
            table.append(
                Register(
                    addresses + 2 * index,
                    2,
                    f"indirect_address_{number}",
                    data + index,
                    lowest=64,
                    highest=max(first + length - 1 for _, first, length in model.indirect),
                )
            )
            table.append(Register(data + index, 1, f"indirect_data_{number}"))
            number += 1
    return table
