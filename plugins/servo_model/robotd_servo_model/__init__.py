"""Servo model shared by the simulated drives of the backends: dynamics and tick-driven time.

A library, no backend: ``servo.py`` has command and response of n axes, ``world.py`` the ticks on
which they run. The simulation backend and the simulated CANopen drives move in the same way.
"""

from robotd_servo_model.servo import Mechanics, Servo
from robotd_servo_model.world import FOREVER, ServoWorld

__all__ = ["FOREVER", "Mechanics", "Servo", "ServoWorld"]
