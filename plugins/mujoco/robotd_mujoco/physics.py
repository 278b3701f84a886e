"""State of robot and surroundings, stepped up to the present by its readers.

There is no thread: each reader and each command first calls ``advance``. The result depends on the
steps alone, not on the times of the calls.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence

import mujoco
import numpy as np

from robotd.api import (
    NANOSECONDS,
    Clock,
    FloatArray,
    IntArray,
    InvalidArgument,
    NotReady,
    Payload,
    RobotDescriptor,
    get_logger,
)
from robotd_mujoco.gripper_model import FINGER_TRAVEL_S
from robotd_mujoco.options import MujocoOptions
from robotd_mujoco.robot_model import (
    BRAKE_NM,
    BRAKE_SHARE,
    PAYLOAD_KG,
    UNLIMITED,
    build_model,
    start_positions,
)

IMAGE_BYTES = 64
AT_REST = 0.02  # rad/s or m/s, below which a brake, or the catch of a guided axis, is done
GUIDING_DAMPING = 0.005  # part of the drive's own: N·m per rad/s that a hand has to overcome
CATCH_S = 0.5  # in which a guided axis comes to rest, unless it is pushed on
FOLLOWING_ERROR, DIVERGED = 0x8611, 0x6100
_DIVERGENCE = (
    mujoco.mjtWarning.mjWARN_INERTIA,
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)

log = get_logger("mujoco")


def _warn(text: str) -> None:
    """Log a warning of MuJoCo, instead of a file in the working folder."""
    log.warning("MuJoCo", reason=text.strip())


def strided(addresses: Sequence[int]) -> slice | IntArray:
    """Return the index of ``addresses``: a slice where one does, which NumPy copies faster."""
    steps = set(np.diff(addresses).tolist())
    if len(addresses) < 2 or len(steps) > 1 or min(steps) < 1:
        return np.array(addresses, np.int64)
    return slice(addresses[0], addresses[-1] + 1, steps.pop())


class Physics:
    """Robot, drives, I/O and objects. Hold ``lock`` for every call; it is re-entrant.

    Raises DescriptorError: the model cannot be made.

    Attributes:
        robot_model: model, and where things are in it.
        model, data: of MuJoCo.
        is_open, talking, frozen: state of the connection; frozen: no further values arrive.
        lost_because: what ended it, until it is opened or communicates again; "": nothing.
        servo_on, connected, alarm_code, reason: of each drive.
        let_go: (n_axes,) a hand moves the axis, or it is being caught; its servo is on.
        encoder_offset: (n_axes,) measured minus true position.
        inputs, outputs: I/O images.
        stuck_outputs: outputs that keep a value, by byte and bit.
        payload: what the drives expect to carry.
        tick: steps so far.
    """

    def __init__(self, robot: RobotDescriptor, options: MujocoOptions, clock: Clock) -> None:
        mujoco.set_mju_user_warning(_warn)
        self.lock = threading.RLock()
        self.robot, self.options, self.clock = robot, options, clock
        self.robot_model = build_model(robot, options)
        self.model, self.drives = self.robot_model.model, self.robot_model.drives
        self.data = mujoco.MjData(self.model)
        self._control = self.data.ctrl  # a view that stays; to get it takes longer than to use it
        self.axes = len(self.drives)
        self.is_open = self.talking = self.frozen = False
        self.lost_because = ""
        self.servo_on, self.let_go, self._blocked = np.zeros((3, self.axes), bool)
        self.connected = np.ones(self.axes, bool)
        self.alarm_code = np.zeros(self.axes, np.int64)
        self.reason = [""] * self.axes
        self.encoder_offset = np.zeros(self.axes)
        self.inputs, self.outputs = bytearray(IMAGE_BYTES), bytearray(IMAGE_BYTES)
        self.stuck_outputs: dict[tuple[int, int], bool] = {}
        self.payload, self.tick = Payload(0.0), 0
        self._step_ns = round(options.step_s * NANOSECONDS)
        self._start_ns = clock.now_ns()
        self._catch_up = max(1, round(options.max_catch_up_s / options.step_s))
        self._period_ticks = max(1.0, 1.0 / robot.cycle.rate_hz / options.step_s)
        self._qpos = strided([drive.qpos for drive in self.drives])
        self._dof = strided([drive.dof for drive in self.drives])
        self._fingers = np.array([finger.qpos for finger in self.robot_model.fingers], int)
        self._position = strided([drive.position for drive in self.drives])
        self._velocity = strided([drive.velocity for drive in self.drives])
        self._gains = self.model.actuator_gainprm.copy(), self.model.actuator_biasprm.copy()
        self._friction = self.model.dof_frictionloss.copy()
        self._braking: set[int] = set()
        self._catching: dict[int, int] = {}  # axis, and tick at which it is held in any case
        self._from = self._to = start_positions(robot, options).copy()
        self._speed = np.zeros(self.axes)
        self._gripper_m = robot.gripper.open_m if robot.gripper else 0.0  # commanded
        self._begin = 0  # tick at which the axes leave ``_from``
        self._warnings = self.data.warning.number
        self._place_robot()
        self._initial, self._good = self.data.qpos.copy(), self.data.qpos.copy()
        for axis in range(self.axes):
            self._switch(axis, on=False)
            self._update_lock(axis)

    # Time

    @property
    def now_ns(self) -> int:
        """Monotonic time of the present step."""
        return self._start_ns + self.tick * self._step_ns

    def advance(self) -> None:
        """Step up to the present; of a long pause the last part only."""
        due = (self.clock.now_ns() - self._start_ns) // self._step_ns
        if due <= self.tick:
            return
        if due > self.tick + self._catch_up:
            lost = due - self.tick - self._catch_up
            self._start_ns += lost * self._step_ns
            if self.talking:
                log.warning("simulated time slipped", lost_s=round(lost * self.options.step_s, 3))
            due -= lost
        self._drive_fingers(due - self.tick)
        for tick in range(self.tick + 1, due + 1):
            self._set_setpoints(tick)
            if self.robot_model.is_free:
                self._load_base()
            mujoco.mj_step(self.model, self.data)
        self.tick = due
        self._look_after_steps()

    def _set_setpoints(self, tick: int) -> None:
        """Command of the drives at the end of step ``tick``."""
        share = (tick - self._begin) / self._period_ticks
        control = self._control
        if share <= 1.0:
            control[self._position] = self._from + share * (self._to - self._from)
            control[self._velocity] = self._speed
        else:
            control[self._position] = self._to
            control[self._velocity] = 0.0

    def _load_base(self) -> None:
        """Set the forces of rollers and weight on a base, for the next step."""
        # Drives carry the links of an arm, but the base is to carry their weight.
        self.data.qfrc_applied[:6] = -self.data.qfrc_gravcomp[:6]
        if self.robot_model.rollers is not None:
            self.robot_model.rollers.drive(self.model, self.data)

    def _look_after_steps(self) -> None:
        if np.count_nonzero(self._warnings):
            self._restore()
        elif self._braking:
            for axis in [*self._braking]:
                if abs(self.data.qvel[self.drives[axis].dof]) < AT_REST:
                    self._braking.discard(axis)
                    self._update_lock(axis)
        for axis, until in [*self._catching.items()]:
            if self.tick >= until or abs(self.data.qvel[self.drives[axis].dof]) < AT_REST:
                self._switch(axis, on=True)
        self._good[:] = self.data.qpos
        self._sense_part()
        error = np.abs(self._to - self.data.qpos[self._qpos])
        late = error > self.options.following_error_rad
        if np.count_nonzero(late):
            follows = self.servo_on & ~self.let_go
            for axis in np.flatnonzero(follows & late).tolist():
                self.trip(axis, FOLLOWING_ERROR)

    def _restore(self) -> None:
        """Put everything to rest after MuJoCo has given up on its state.

        MuJoCo resets a state that diverges and goes on; only its counters of warnings show it.
        """
        diverged = self._warnings[[int(warning) for warning in _DIVERGENCE]].any()
        self._warnings[:] = 0
        if not diverged:  # a buffer is full: contacts are missing, which it has logged
            return
        locks = self.data.eq_active.copy()
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.qvel[:] = self._good, 0.0
        for free in self.robot_model.free_qpos:
            if free >= 0:
                self.data.qpos[free : free + 7] = self._initial[free : free + 7]
        self.data.eq_active[:] = locks
        mujoco.mj_forward(self.model, self.data)
        log.error("the physics diverged: the robot is at rest, objects are back at their start")
        for axis in range(self.axes):
            self.trip(axis, DIVERGED)

    # Drives

    def positions(self) -> FloatArray:
        """Return the true positions (n_axes,)."""
        return self.data.qpos[self._qpos].copy()

    def velocities(self) -> FloatArray:
        """Return the velocities (n_axes,)."""
        return self.data.qvel[self._dof].copy()

    def torques(self) -> FloatArray:
        """Return the torques of the motors at the joints (n_axes,), N·m or N."""
        return self.data.qfrc_actuator[self._dof].copy()

    def follow(self, targets: FloatArray) -> None:
        """Reach ``targets`` (n_axes,), as measured, one control period from now."""
        command = self.data.ctrl[self._position].copy()
        targets = targets - self.encoder_offset
        follows = np.isfinite(targets) & (self.servo_on > self.let_go)
        if np.count_nonzero(follows) < self.axes:
            targets = np.where(follows, targets, command)
        self._from, self._to, self._begin = command, targets, self.tick
        self._speed = (targets - command) / (self._period_ticks * self.options.step_s)

    def enable(self, axis: int) -> None:
        """Switch the drive on where the axis is. Raises NotReady."""
        if not self.talking or not self.connected[axis]:
            raise NotReady("the drive does not answer", axis=axis)
        if self.alarm_code[axis]:
            raise NotReady(f"the drive is in alarm 0x{self.alarm_code[axis]:X}", axis=axis)
        if not self.servo_on[axis]:
            self._switch(axis, on=True)

    def disable(self, axis: int) -> None:
        """Switch the drive off; its brake stops the axis."""
        if self.servo_on[axis]:
            self._switch(axis, on=False)

    def guide(self, axis: int) -> None:
        """Let a hand move the axis: its drive carries its weight, and damps its speed a little."""
        drive, (gain, bias) = self.drives[axis], self._gains
        self.let_go[axis] = True
        self._set_gains(drive.position, 0.0 * gain[drive.position], 0.0 * bias[drive.position])
        damping = GUIDING_DAMPING * gain[drive.velocity], GUIDING_DAMPING * bias[drive.velocity]
        self._set_gains(drive.velocity, *damping)

    def catch(self, axis: int) -> None:
        """Slow a guided axis down by the damping of its drive, then hold it where it is."""
        if self.let_go[axis]:
            gain, bias = self._gains
            velocity = self.drives[axis].velocity
            self._set_gains(velocity, gain[velocity], bias[velocity])
            self._catching[axis] = self.tick + round(CATCH_S / self.options.step_s)

    def expect(self, payload: Payload) -> None:
        """Let the drives carry a weight at the last link, within their torque limits."""
        body = self.robot_model.payload
        self.model.body_ipos[body] = payload.center_m
        self.model.body_gravcomp[body] = 1.0 + payload.mass_kg / PAYLOAD_KG
        self.payload = payload

    def trip(self, axis: int, code: int) -> None:
        """Put the drive into alarm."""
        self.alarm_code[axis] = code
        if self.connected[axis]:  # else the reason is that it does not answer
            self.reason[axis] = _alarm_text(code)
        self.disable(axis)

    def clear(self, axis: int) -> None:
        """Clear the alarm of the drive. Raises NotReady: it does not answer."""
        if not self.connected[axis]:
            raise NotReady("the drive does not answer", axis=axis)
        self.alarm_code[axis], self.reason[axis] = 0, ""

    def connect(self, axis: int, *, connected: bool) -> None:
        """Plug the drive in, or pull its plug."""
        self.connected[axis] = connected
        code = int(self.alarm_code[axis])
        back = _alarm_text(code) if code else ""
        self.reason[axis] = back if connected else "does not answer: cable or power supply"
        if not connected:
            self.disable(axis)

    def block(self, axis: int, *, blocked: bool) -> None:
        """Hold the axis where it is, or let it go."""
        self._blocked[axis] = blocked
        self._update_lock(axis)

    def turn(self, axis: int, delta: float) -> None:
        """Turn an axis by hand; it stays there."""
        drive = self.drives[axis]
        self.data.qpos[drive.qpos] += delta
        self.data.qvel[drive.dof] = 0.0
        self._update_lock(axis)
        mujoco.mj_forward(self.model, self.data)

    def silence(self) -> None:
        """End the cyclic exchange: drives switch off by themselves."""
        self.talking = False
        for axis in range(self.axes):
            self.disable(axis)

    def _switch(self, axis: int, *, on: bool) -> None:
        drive, model = self.drives[axis], self.model
        self.servo_on[axis], self.let_go[axis] = on, False
        self._catching.pop(axis, None)
        for actuator in (drive.position, drive.velocity):
            gain, bias = (values[actuator] * float(on) for values in self._gains)
            self._set_gains(actuator, gain, bias)
        model.jnt_actfrcrange[drive.joint] = (-drive.effort, drive.effort) if on else 0.0
        position = self.data.qpos[drive.qpos]
        self._from, self._to = self._from.copy(), self._to.copy()
        self._from[axis] = self._to[axis] = self.data.ctrl[drive.position] = position
        self._speed[axis] = self.data.ctrl[drive.velocity] = 0.0
        self._braking.discard(axis)
        if self.options.brakes and not on:
            self._braking.add(axis)
        self._update_lock(axis)

    def _set_gains(self, actuator: int, gain: FloatArray, bias: FloatArray) -> None:
        self.model.actuator_gainprm[actuator], self.model.actuator_biasprm[actuator] = gain, bias

    def _update_lock(self, axis: int) -> None:
        """Let the friction of the brake, or the lock behind it, act."""
        drive = self.drives[axis]
        braked = self.options.brakes and not self.servo_on[axis]
        slows = axis in self._braking and not self._blocked[axis]
        brake = BRAKE_SHARE * drive.effort if drive.effort < UNLIMITED else BRAKE_NM
        self.model.dof_frictionloss[drive.dof] = brake if slows else self._friction[drive.dof]
        self.model.eq_data[drive.lock, 0] = self.data.qpos[drive.qpos]
        self.data.eq_active[drive.lock] = self._blocked[axis] or (braked and not slows)

    def wrenches(self) -> FloatArray:
        """Return force and torque (n_wrists, 6) on the arm at each wrist, N and N·m.

        In the frame of the link: that of a hanging load points down.
        """
        sensors = self.robot_model.sensors
        with self.lock:  # MuJoCo has the force of the arm on the link
            return -np.array([self.data.sensordata[address : address + 6] for address in sensors])

    # I/O and gripper

    def write_outputs(self, byte: int, values: bytes) -> None:
        """Write outputs, except those that are stuck."""
        self.outputs[byte : byte + len(values)] = values
        self.keep_stuck()

    def keep_stuck(self) -> None:
        """Give stuck outputs their values."""
        for (byte, bit), value in self.stuck_outputs.items():
            self.outputs[byte] = self.outputs[byte] & ~(1 << bit) | int(value) << bit

    def set_input(self, byte: int, bit: int, *, value: bool) -> None:
        """Let a sensor change one input."""
        self.inputs[byte] = self.inputs[byte] & ~(1 << bit) | int(value) << bit

    def fingers(self) -> FloatArray:
        """Return the positions of the fingers (fingers,)."""
        return self.data.qpos[self._fingers]

    def held_object(self) -> str:
        """Return the name of an object that all fingers touch; "" without one."""
        if not self.data.ncon or not self.robot_model.fingers:
            return ""
        pairs = self.model.geom_bodyid[self.data.contact.geom].tolist()
        touched = []
        for finger in self.robot_model.fingers:
            touched.append({body for pair in pairs if finger.body in pair for body in pair})
            if not touched[-1]:
                return ""
        common = set.intersection(*touched)
        for body, thing in zip(self.robot_model.bodies, self.robot_model.objects, strict=True):
            if body in common and thing.moves:
                return thing.name
        return ""

    def _drive_fingers(self, steps: int) -> None:
        """Let the command of the fingers travel to the end that the output bit names."""
        gripper = self.robot.gripper
        if gripper is None or not self.robot_model.fingers:
            return
        closed = self.outputs[gripper.output_byte] >> gripper.output_bit & 1
        end = gripper.closed_m if closed else gripper.open_m
        travel_s = gripper.travel_time_s or FINGER_TRAVEL_S
        distance = steps * self.options.step_s / travel_s * abs(gripper.closed_m - gripper.open_m)
        self._gripper_m += min(max(end - self._gripper_m, -distance), distance)
        for finger in self.robot_model.fingers:
            self.data.ctrl[finger.motor] = finger.factor * self._gripper_m

    def _sense_part(self) -> None:
        gripper = self.robot.gripper
        if gripper is not None and gripper.part_sensor is not None and self.robot_model.fingers:
            sensor = gripper.part_sensor
            self.set_input(sensor.input_byte, sensor.input_bit, value=bool(self.held_object()))

    # Objects

    def root_pose(self) -> FloatArray:
        """Return x, y, z and quaternion x, y, z, w (7,) of a free root in the scene."""
        return self.data.qpos[[0, 1, 2, 4, 5, 6, 3]]

    def root_twist(self) -> FloatArray:
        """Return linear and angular velocity (6,) of the robot's root, in its own frame."""
        twist = np.empty(6)  # MuJoCo has the angular one first
        body, root = mujoco.mjtObj.mjOBJ_XBODY.value, self.robot_model.root_body
        mujoco.mj_objectVelocity(self.model, self.data, body, root, twist, 1)
        return twist[[3, 4, 5, 0, 1, 2]]

    def object_poses(self) -> FloatArray:
        """Return x, y, z and quaternion x, y, z, w of all objects (n, 7), seen from the root."""
        data, root, bodies = self.data, self.robot_model.root_body, self.robot_model.bodies
        poses = np.empty((len(bodies), 7))
        poses[:, :3] = (data.xpos[bodies] - data.xpos[root]) @ data.xmat[root].reshape(3, 3)
        back, turn = np.empty(4), np.empty(4)
        mujoco.mju_negQuat(back, data.xquat[root])
        for pose, body in zip(poses, bodies, strict=True):
            mujoco.mju_mulQuat(turn, back, data.xquat[body])
            pose[3:] = turn[[1, 2, 3, 0]]
        return poses

    def place_object(self, name: str, pose: FloatArray) -> None:
        """Put an object to ``pose`` (7,), at rest. Raises InvalidArgument."""
        names = [item.name for item in self.robot_model.objects]
        if name not in names:
            raise InvalidArgument(f"object {name!r} is unknown (available: {', '.join(names)})")
        free = self.robot_model.free_qpos[names.index(name)]
        if free < 0:
            raise InvalidArgument(f"{name} is fixed")
        quaternion = pose[[6, 3, 4, 5]]
        size = float(np.linalg.norm(quaternion))
        if not (np.isfinite(pose).all() and size > 1e-6):
            raise InvalidArgument(f"{name}: {pose.tolist()} is not a pose")
        root = self.robot_model.root_body
        at = self.data.xpos[root] + self.data.xmat[root].reshape(3, 3) @ pose[:3]
        turn = np.empty(4)
        mujoco.mju_mulQuat(turn, self.data.xquat[root], quaternion / size)
        self._set_object(free, at, turn)
        mujoco.mj_forward(self.model, self.data)

    def reset_objects(self) -> None:
        """Put all objects back to their first poses, at rest."""
        for free in self.robot_model.free_qpos:
            if free >= 0:
                pose = self._initial[free : free + 7]
                self._set_object(free, pose[:3], pose[3:])
        mujoco.mj_forward(self.model, self.data)

    def _set_object(self, free: int, position: FloatArray, quaternion: FloatArray) -> None:
        self.data.qpos[free : free + 3], self.data.qpos[free + 3 : free + 7] = position, quaternion
        joint = int(np.flatnonzero(self.model.jnt_qposadr == free)[0])
        dof = self.model.jnt_dofadr[joint]
        self.data.qvel[dof : dof + 6] = 0.0

    def _place_robot(self) -> None:
        self.data.qpos[self._qpos] = self._to
        gripper = self.robot.gripper
        if gripper is not None:
            for finger in self.robot_model.fingers:
                self.data.qpos[finger.qpos] = gripper.open_m * finger.factor
        mujoco.mj_forward(self.model, self.data)


ALARMS = {
    0x2310: "continuous overcurrent",
    0x3210: "DC link over-voltage",
    0x3220: "DC link under-voltage",
    0x4210: "device too hot",
    0x4310: "drive too hot",
    DIVERGED: "the physics diverged",
    0x7121: "motor blocked",
    0x7305: "encoder fault",
    FOLLOWING_ERROR: "following error",
}


def _alarm_text(code: int) -> str:
    return ALARMS.get(code, f"error 0x{code:04X}")
