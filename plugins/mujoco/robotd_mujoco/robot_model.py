"""Robot, drives and surroundings as one MuJoCo model.

A drive is a position and a velocity actuator on its joint, so that the force is
kp·(p - q) + kv·(v - q') with the setpoint p, v. They are set for a critically damped loop of the
bandwidth in the options, with the largest inertia that the joint has in a sample of poses. The
drives compensate gravity, within their torque limits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from robotd.api import (
    DescriptorError,
    FloatArray,
    RobotDescriptor,
    WorldCamera,
    WorldObject,
    get_logger,
)
from robotd_mujoco.base_model import (
    Rollers,
    add_base,
    carried_inertia,
    find_rollers,
    has_free_root,
    is_free,
)
from robotd_mujoco.gripper_model import (
    STIFF_IMPEDANCE,
    STIFF_REFERENCE,
    Finger,
    add_gripper,
    find_fingers,
    make_stiff,
)
from robotd_mujoco.options import MujocoOptions, robot_file
from robotd_mujoco.scene import (
    PREFIX,
    Scene,
    add_cameras,
    add_objects,
    describe_cameras,
    describe_objects,
    load_scene,
)
from robotd_mujoco.urdf_import import import_urdf

INERTIA_POSES = 64
FAR = 1e3  # rad or m; exporters write 1e308 for "no limit"
ROTOR_KG, ROTOR_KG_M2 = 1.0, 0.1  # of an axis that is not a joint of the URDF
BRAKE_SHARE = 1.5  # torque of a brake per torque of its drive
BRAKE_NM = 200.0  # of one without a torque limit
UNLIMITED = 1e6  # N·m or N
PAYLOAD, PAYLOAD_KG = "robotd_payload", 1e-3  # body without a weight that counts

log = get_logger("mujoco")


@dataclass(frozen=True)
class Drive:
    """Addresses and limits of one axis in the model.

    Attributes:
        joint, position, velocity: numbers of the joint and of its actuators.
        qpos, dof: addresses of its position and velocity.
        lock: number of the equality that holds it.
        effort: N·m or N; ``UNLIMITED`` without a limit.
    """

    joint: int
    position: int
    velocity: int
    qpos: int
    dof: int
    lock: int
    effort: float


@dataclass
class RobotModel:
    """Compiled model and where things are in it.

    Attributes:
        drives: of each axis.
        fingers: of the gripper; empty without one.
        objects, bodies: of the scene, and their bodies.
        free_qpos: address of the position of each object; -1: it is fixed.
        cameras: of the scene.
        root: name of the frame that poses of objects refer to.
        root_body: of that frame.
        is_free: the root can move: a base on a floor.
        rollers: of mecanum wheels; None without them.
        wrists: links after the last joint of each arm, with a force/torque sensor.
        sensors: address of the first value of each one: force and torque.
        payload: body whose weight the drives expect at the last link; -1: there is not one arm.
    """

    model: mujoco.MjModel
    drives: list[Drive]
    fingers: list[Finger]
    objects: list[WorldObject]
    bodies: list[int]
    free_qpos: list[int]
    cameras: list[WorldCamera]
    root: str
    root_body: int
    is_free: bool
    rollers: Rollers | None
    wrists: list[str]
    sensors: list[int]
    payload: int = -1


def build_model(robot: RobotDescriptor, options: MujocoOptions) -> RobotModel:
    """Put the model together. Raises DescriptorError: a file is wrong, or MuJoCo rejects it."""
    try:
        return _build_model(_called_as_in_mjcf(robot, options), options)
    except ValueError as error:
        raise DescriptorError(f"MuJoCo rejects the model: {error}", path=robot.path) from error


def _build_model(robot: RobotDescriptor, options: MujocoOptions) -> RobotModel:
    spec = _robot_spec(robot, options)
    on_wheels = is_free(robot, options, spec)
    scene = Scene(floor=on_wheels)
    root = next((body.name for body in spec.worldbody.bodies), "world")
    links = [body.name for body in spec.bodies[1:]]
    joints = _axis_joints(robot, spec)
    _prepare_links(spec, options)
    if options.scene is not None:
        scene_file = robot_file(robot, options.scene)
        if scene_file.suffix == ".xml":
            surroundings = _read(scene_file)
            spec.attach(surroundings, frame=spec.worldbody.add_frame(), prefix=PREFIX)
        else:
            scene = load_scene(scene_file, links)
            add_objects(spec, scene, scene_file.parent)
    elif on_wheels:
        add_objects(spec, scene, Path())
    objects = describe_objects(spec, links)
    _add_drives(spec, robot, options, joints)
    wrists, payload = _add_wrists(spec, robot), _add_payload(spec, robot)
    add_gripper(spec, robot, options)
    add_cameras(spec, scene.cameras)
    if on_wheels:
        add_base(spec, robot, options)
    _set_physics(spec, options)
    model = spec.compile()
    start = start_positions(robot, options)
    if options.self_collision:
        _exclude_touching(spec, model, links, joints, start)
        model = spec.compile()
    _tune(model, robot, joints, options)
    described = _described(model, robot, objects, wrists, joints, root, options, scene)
    described.payload = model.body(payload).id if payload else -1
    return described


def start_positions(robot: RobotDescriptor, options: MujocoOptions) -> FloatArray:
    """Return the option, or the descriptor's position of each joint and 0 of other axes."""
    if options.initial_position_rad is not None:
        return np.array(options.initial_position_rad)
    start = np.zeros(robot.axes)
    for joint in robot.joints:
        start[joint.axis] = joint.initial_position
    return start


def _called_as_in_mjcf(robot: RobotDescriptor, options: MujocoOptions) -> RobotDescriptor:
    """Return the robot with the joint names of its MJCF. Raises DescriptorError: no such joint."""
    names, drive, gripper = options.mjcf_joints, robot.drive, robot.gripper
    if not names:
        return robot

    def renamed(joints: Sequence[str]) -> tuple[str, ...]:
        return tuple(names.get(joint, joint) for joint in joints)

    own = [joint.name for joint in robot.joints]
    own += [*(drive.wheel_joints if drive else ()), *(gripper.joints if gripper else ())]
    if unknown := names.keys() - set(own):
        text = f"{', '.join(sorted(unknown))}: no joint of the robot ({', '.join(own)})"
        raise DescriptorError(text, path=robot.path, key="backends.mujoco.mjcf_joints")
    joints = [
        joint.model_copy(update={"name": names.get(joint.name, joint.name)})
        for joint in robot.joints
    ]
    changed: dict[str, Any] = {"joints": type(robot.joints)(joints)}
    if drive is not None:
        changed["drive"] = drive.model_copy(update={"wheel_joints": renamed(drive.wheel_joints)})
    if gripper is not None:
        changed["gripper"] = gripper.model_copy(update={"joints": renamed(gripper.joints)})
    return robot.model_copy(update=changed)


def _robot_spec(robot: RobotDescriptor, options: MujocoOptions) -> mujoco.MjSpec:
    if options.mjcf is None:
        return import_urdf(robot.urdf) if robot.urdf else mujoco.MjSpec()
    file = robot_file(robot, options.mjcf)
    spec = _read(file)
    for name in options.mjcf_joints.values():
        if spec.joint(name) is None:
            known = ", ".join(joint.name for joint in spec.joints if joint.name)
            raise DescriptorError(f"the MJCF has no joint {name!r} (it has {known})", path=file)
    for sensor in list(spec.sensors):
        if sensor.objtype == mujoco.mjtObj.mjOBJ_ACTUATOR:
            spec.delete(sensor)
    for element in (*spec.actuators, *spec.keys):
        spec.delete(element)
    for number, body in enumerate(spec.bodies):
        body.name = body.name or f"body{number}"  # names are optional in MuJoCo
    return spec


def _read(path: Path) -> mujoco.MjSpec:
    try:
        return mujoco.MjSpec.from_file(str(path))
    except ValueError as error:
        raise DescriptorError(f"MuJoCo does not read it: {error}", path=path) from error


def _axis_joints(robot: RobotDescriptor, spec: mujoco.MjSpec) -> list[str]:
    """Return the name of each axis' joint; axes without one get a rotor."""
    names = {joint.axis: joint.name for joint in robot.joints}
    if robot.drive is not None:
        names |= dict(zip(robot.drive.axes, robot.drive.wheel_joints, strict=False))
    linear = {joint.axis for joint in robot.joints if joint.unit == "m"}
    found = []
    for axis in range(robot.axes):
        name = names.get(axis, f"axis{axis}")
        if spec.joint(name) is None:
            if axis in names and (robot.urdf or not robot.joints):
                log.warning("not in the model: the axis turns beside the robot", joint=name)
            body = spec.worldbody.add_body(name=f"{name}_rotor", pos=[0.0, 0.0, 0.0])
            body.mass, body.inertia = ROTOR_KG, [ROTOR_KG_M2] * 3
            body.explicitinertial = True
            kind = mujoco.mjtJoint.mjJNT_SLIDE if axis in linear else mujoco.mjtJoint.mjJNT_HINGE
            body.add_joint(name=name, type=kind, axis=[0.0, 0.0, 1.0])
        found.append(name)
    return found


def _prepare_links(spec: mujoco.MjSpec, options: MujocoOptions) -> None:
    """Compensate the weight of links, and let them touch each other or not."""
    for body in spec.worldbody.bodies:
        body.pos = body.pos + np.array(options.base_m)
    for body in spec.bodies[1:]:
        body.gravcomp = 1.0
        for geom in body.geoms:
            if geom.contype or geom.conaffinity:
                # Links: 2, objects: 1; a link touches objects, and other links if it may.
                geom.contype, geom.conaffinity = 2, 3 if options.self_collision else 1
                geom.condim = 4


def _add_drives(
    spec: mujoco.MjSpec, robot: RobotDescriptor, options: MujocoOptions, joints: Sequence[str]
) -> None:
    efforts = {joint.axis: joint.effort_limit for joint in robot.joints}
    for axis, name in enumerate(joints):
        joint = spec.joint(name)
        joint.armature = max(joint.armature, options.rotor_inertia_kg_m2)
        if not joint.damping[0]:
            joint.damping[0] = options.viscous_friction_nm_s
        # MuJoCo's soft friction would let a loaded joint creep at 0.14 rad/s under its brake.
        joint.solref_friction = [STIFF_REFERENCE * options.step_s, 1.0]
        joint.solimp_friction = STIFF_IMPEDANCE
        effort = efforts.get(axis) or (joint.actfrcrange[1] if joint.actfrclimited else 0.0)
        joint.actfrcrange = [-effort, effort] if effort else [-UNLIMITED, UNLIMITED]
        joint.actfrclimited = mujoco.mjtLimited.mjLIMITED_TRUE
        joint.actgravcomp = True
        for kind in ("position", "velocity"):
            spec.add_actuator(
                name=f"{name}_{kind}", target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT,
                gaintype=mujoco.mjtGain.mjGAIN_FIXED, biastype=mujoco.mjtBias.mjBIAS_AFFINE,
            )  # fmt: skip
        _add_lock(spec, name, options)


def _add_lock(spec: mujoco.MjSpec, joint: str, options: MujocoOptions) -> None:
    lock = spec.add_equality(
        name=f"{joint}_lock", type=mujoco.mjtEq.mjEQ_JOINT, name1=joint, active=False
    )
    lock.objtype = mujoco.mjtObj.mjOBJ_JOINT
    make_stiff(lock, options)


def _add_wrists(spec: mujoco.MjSpec, robot: RobotDescriptor) -> list[str]:
    """Add a force/torque sensor after the last joint of each arm; return its link.

    It measures what the link and all beyond it exert on the arm, in the frame of the link.
    """
    wrists = _last_links(spec, [joint.name for joint in robot.joints])
    for link in wrists:
        spec.body(link).add_site(name=f"{link}_wrist")
        for kind, sensor in (
            ("force", mujoco.mjtSensor.mjSENS_FORCE),
            ("torque", mujoco.mjtSensor.mjSENS_TORQUE),
        ):
            spec.add_sensor(
                name=f"{link}_{kind}", type=sensor, objname=f"{link}_wrist",
                objtype=mujoco.mjtObj.mjOBJ_SITE,
            )  # fmt: skip
    return wrists


def _last_links(spec: mujoco.MjSpec, joints: Sequence[str]) -> list[str]:
    """Return the links that those of ``joints`` move after which there is none of them."""
    names = [name for name in joints if spec.joint(name) is not None]
    inner = set()
    for name in names:
        body = spec.joint(name).parent.parent
        while body is not None:
            inner |= {joint.name for joint in body.joints}
            body = body.parent
    return [spec.joint(name).parent.name for name in names if name not in inner]


def _add_payload(spec: mujoco.MjSpec, robot: RobotDescriptor) -> str:
    """Add a body whose weight the drives are to expect; return its name, "" without one arm."""
    grippers = {settings.joint for settings in robot.servo_grippers.values()}
    names = [joint.name for joint in robot.joints if joint.name not in grippers]
    links = _last_links(spec, names)
    if len(links) != 1:
        return ""
    body = spec.body(links[0]).add_body(name=PAYLOAD)
    body.mass, body.inertia, body.explicitinertial = PAYLOAD_KG, [PAYLOAD_KG * 1e-6] * 3, True
    body.gravcomp = 1.0
    return PAYLOAD


def _set_physics(spec: mujoco.MjSpec, options: MujocoOptions) -> None:
    spec.option.timestep = options.step_s
    spec.option.gravity = options.gravity_m_s2
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # Friction that holds a part for minutes: elliptic cones, stiff against slip.
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10.0
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1920, 1080
    spec.visual.quality.shadowsize = 0


def _exclude_touching(
    spec: mujoco.MjSpec,
    model: mujoco.MjModel,
    links: Sequence[str],
    joints: Sequence[str],
    start: FloatArray,
) -> None:
    """Exclude contacts of neighbours, and of links that touch at 0 or at the start."""
    pairs = {frozenset((link, spec.body(link).parent.name)) for link in links}
    data = mujoco.MjData(model)
    for positions in (np.zeros(len(joints)), start):
        for name, position in zip(joints, positions, strict=True):
            data.joint(name).qpos[0] = position
        mujoco.mj_forward(model, data)
        for contact in data.contact:
            names = [model.body(model.geom_bodyid[geom]).name for geom in contact.geom]
            if set(names) <= set(links):
                pairs.add(frozenset(names))
    for pair in sorted(sorted(pair) for pair in pairs if len(pair) == 2):
        if "world" not in pair:
            spec.add_exclude(bodyname1=pair[0], bodyname2=pair[1])


def _tune(
    model: mujoco.MjModel, robot: RobotDescriptor, joints: Sequence[str], options: MujocoOptions
) -> None:
    """Set the gains of the drives by the largest inertia in a sample of poses."""
    data, random = mujoco.MjData(model), np.random.default_rng(0)
    inertia, full = np.zeros(model.nv), np.zeros((model.nv, model.nv))
    for _ in range(INERTIA_POSES):
        for name in joints:
            joint = model.joint(name)
            low, high = joint.range.clip(-FAR, FAR) if joint.limited[0] else (-np.pi, np.pi)
            data.joint(name).qpos[0] = random.uniform(low, high)
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, full)
        np.maximum(inertia, np.diag(full), out=inertia)
    frequency = 2.0 * np.pi * options.bandwidth_hz
    carried = carried_inertia(model, robot)
    for name in joints:
        size = inertia[model.joint(name).dofadr[0]] + carried.get(name, 0.0)
        gains = {
            "position": (size * frequency**2, 1),
            "velocity": (2.0 * size * frequency, 2),
        }
        for kind, (gain, column) in gains.items():
            actuator = model.actuator(f"{name}_{kind}")
            actuator.gainprm[0], actuator.biasprm[column] = gain, -gain


def _described(
    model: mujoco.MjModel,
    robot: RobotDescriptor,
    objects: list[WorldObject],
    wrists: list[str],
    joints: Sequence[str],
    root: str,
    options: MujocoOptions,
    scene: Scene,
) -> RobotModel:
    drives = []
    for name in joints:
        joint = model.joint(name)
        effort = float(model.jnt_actfrcrange[joint.id, 1])
        drives.append(
            Drive(
                joint.id,
                model.actuator(f"{name}_position").id,
                model.actuator(f"{name}_velocity").id,
                int(joint.qposadr[0]),
                int(joint.dofadr[0]),
                model.equality(f"{name}_lock").id,
                effort,
            )
        )
    bodies = [_body(model, item.name) for item in objects]
    free = [
        int(model.jnt_qposadr[model.body_jntadr[body]]) if item.moves else -1
        for item, body in zip(objects, bodies, strict=True)
    ]
    return RobotModel(
        model=model,
        drives=drives,
        fingers=find_fingers(model, robot),
        objects=objects,
        bodies=bodies,
        free_qpos=free,
        cameras=describe_cameras(scene.cameras),
        root=root,
        root_body=model.body(root).id,
        is_free=has_free_root(model),
        rollers=find_rollers(model, robot, options),
        wrists=wrists,
        sensors=[int(model.sensor(f"{link}_force").adr[0]) for link in wrists],
    )


def _body(model: mujoco.MjModel, name: str) -> int:
    """Return the number of an object's body, of a scene in YAML or in MJCF."""
    names = {model.body(number).name: number for number in range(model.nbody)}
    return names[name] if name in names else names[PREFIX + name]
