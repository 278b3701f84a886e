"""Servo on and off, alarms, and slaves that come and go."""

from __future__ import annotations

from collections.abc import Callable

from robotd.api import FloatArray, NotReady
from robotd_servo_model.world import ServoWorld
from robotd_sim.alarms import NO_ANSWER, alarm_text
from robotd_sim.axis_states import AxisStates
from robotd_sim.motion import Motion
from robotd_sim.scaling import Scaling
from robotd_wmx_parameters import WmxParameters

ENABLE_TICKS = 3  # from the request to the drive's "operation enabled"
CLEAR_TICKS = 1


class Power:
    """The drives' state machines, as far as they show. Hold the world's lock."""

    def __init__(
        self,
        world: ServoWorld,
        states: AxisStates,
        motion: Motion,
        scaling: Scaling,
        coast_deceleration: FloatArray,
    ) -> None:
        self._world, self._servo, self._states = world, world.servo, states
        self._motion, self._scaling, self._coasting = motion, scaling, coast_deceleration
        self.on_home_lost: Callable[[], None] = lambda: None

    def configure(self, parameters: WmxParameters) -> None:
        axes = self._servo.axes
        self._off_in_alarm = parameters["ServoOffDuringAmpAlarm"][:axes]
        self._home_lost_when_off = parameters["ClearHomeDoneOnServoOff"][:axes]
        self._enable_error_counts = parameters["ServoOnFollowingError"][:axes]
        self._quick_stop_dec = parameters["QuickStopDec"][:axes]

    def request(self, axis: int, *, on: bool) -> None:
        """Request servo on or off; the drive follows a few ticks later.

        Raises NotReady when the axis turns so fast that command and measured position would be
        further apart within one tick than ServoOnFollowingError allows.
        """
        tick_counts = abs(
            self._servo.velocity(axis) * self._servo.tick_s * self._scaling.gain[axis]
        )
        limit = int(self._enable_error_counts[axis])
        if on and not self._states.servo_on[axis] and tick_counts > limit:
            raise NotReady(
                f"servo on rejected while it moves: {tick_counts:.0f} counts a cycle,"
                f" ServoOnFollowingError allows {limit}",
                axis=axis,
            )
        self._states.servo_wanted[axis] = on
        self._world.at(
            self._world.tick + (ENABLE_TICKS if on else 1), lambda: self._obey(axis, on=on)
        )

    def turn_off(self, axis: int) -> None:
        """Switch off at once: the axis coasts, its command follows, its motion is dropped."""
        states, servo = self._states, self._servo
        states.servo_wanted[axis] = False
        if not states.servo_on[axis]:
            return
        states.servo_on[axis] = False
        position, velocity = float(servo.position[axis]), servo.velocity(axis)
        servo.close_loop(axis, closed=False)
        servo.place(axis, position, position, velocity)
        self.coast(axis)
        if self._home_lost_when_off[axis]:
            self.lose_home(axis)

    def coast(self, axis: int) -> None:
        """Slow down by friction, from the present position and speed. The servo is off."""
        self._motion.coast(axis, float(self._coasting[axis]))

    def trip(self, axis: int, code: int) -> None:
        """The drive reports the alarm ``code``."""
        self._states.amp_alarm[axis] = True
        self._states.alarm_code[axis] = code
        if self._off_in_alarm[axis]:
            self.turn_off(axis)
        else:
            self._motion.quick_stop(axis)
        if self._states.connected[axis]:  # else the reason is that it does not answer
            self._states.reason[axis] = alarm_text(code)

    def clear(self, axis: int) -> None:
        """Clear alarms, effective a tick later."""

        def clear() -> None:
            self._states.amp_alarm[axis] = False
            self._states.alarm_code[axis] = 0
            if self._states.connected[axis]:
                self._states.reason[axis] = ""

        self._world.at(self._world.tick + CLEAR_TICKS, clear)

    def connect(self, axis: int, *, connected: bool) -> None:
        """The slave of ``axis`` answers or not; without it the drive is off and unhomed."""
        states = self._states
        states.connected[axis] = connected
        if connected:
            code = int(states.alarm_code[axis])
            states.reason[axis] = alarm_text(code) if states.amp_alarm[axis] else ""
        else:
            self.turn_off(axis)
            self.lose_home(axis)
            states.reason[axis] = f"slave {axis} {NO_ANSWER}"

    def lose_home(self, axis: int) -> None:
        self._states.home_done[axis] = False
        self.on_home_lost()

    def _obey(self, axis: int, *, on: bool) -> None:
        states = self._states
        if states.servo_wanted[axis] != on:
            return
        if not on:
            self.turn_off(axis)
        elif states.connected[axis] and not states.amp_alarm[axis] and not states.servo_on[axis]:
            self._turn_on(axis)

    def _turn_on(self, axis: int) -> None:
        """Close the loop at the present position and speed; then brake."""
        servo = self._servo
        position, velocity = float(servo.position[axis]), servo.velocity(axis)
        servo.close_loop(axis, closed=True)
        servo.place(axis, position, position + servo.lead(axis, velocity), velocity)
        self._states.servo_on[axis] = True
        if velocity:
            self._motion.brake(axis, float(self._quick_stop_dec[axis]))
        else:
            self._motion.hold(axis, position)
