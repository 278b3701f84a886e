"""Models of a robot descriptor: frozen, an unknown key is an error.

Numbers are SI and every key ends in its unit. The descriptions below are the reference: the
tables of the robots' README are made from them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, PrivateAttr

from robotd.descriptor.base_kinds import Drive
from robotd.descriptor.drive_settings import DriveSettings
from robotd.descriptor.group_settings import ALL_JOINTS, GroupSettings, group_problems
from robotd.descriptor.inheritance import merge
from robotd.descriptor.io_settings import (
    GripperSettings,
    IoAddress,
    IoNames,
    StopInputSettings,
)
from robotd.descriptor.joint_settings import JointSettings
from robotd.descriptor.section import (
    MAX_AXES,
    File,
    Name,
    NotNegative,
    Positive,
    Problem,
    Section,
    twice,
)
from robotd.descriptor.servo_gripper_settings import (
    ServoGripperSettings,
    servo_gripper_problems,
)
from robotd.descriptor.yaml_tree import YamlNode
from robotd.errors import DescriptorError

DEFAULT_RATE_HZ = 500.0


def _ros_value(value: Any) -> Any:
    """Accept a ROS parameter: a scalar, or a list of scalars of one type."""
    scalars = value if isinstance(value, list) else [value]
    if not all(isinstance(item, bool | int | float | str) for item in scalars):
        raise ValueError("must be a boolean, a number, a string, or a list of one of these")
    if len({type(item) for item in scalars}) > 1:
        raise ValueError("must be a list of one type (write 1.0, not 1, among numbers like 0.5)")
    if any(isinstance(item, float) and not math.isfinite(item) for item in scalars):
        raise ValueError("must be finite")
    return value


def _empty_if_null(value: Any) -> Any:
    return {} if value is None else value


Settings = TypeVar("Settings", bound=BaseModel)

RosValue = Annotated[Any, AfterValidator(_ros_value)]
Options = Annotated[dict[str, Any], BeforeValidator(_empty_if_null)]


class CycleSettings(Section):
    """The real-time loop that reads the device and streams setpoints."""

    rate_hz: float = Field(DEFAULT_RATE_HZ, ge=10, le=2000, description="Periods per second.")
    realtime_priority: int = Field(
        60, ge=0, le=99, description="SCHED_FIFO priority, where the system grants it; 0: none."
    )
    niceness: int = Field(
        0,
        ge=-20,
        le=0,
        description="Niceness of all threads of `robotd run`, where the system grants it; -10 on a "
        "computer with other work.",
    )


class EngineSettings(Section):
    """Start, retries, time-outs and staleness limits of the device."""

    enable_at_start: bool = Field(
        True,
        description="Switch the servos on when `robotd run` starts; false: `robotd servo on` does, "
        "so that a restart by a supervisor energises nothing.",
    )
    open_tries: int = Field(5, ge=1, le=1000, description="Attempts to open the device.")
    open_retry_s: NotNegative = Field(2.0, description="Pause between two attempts.")
    reconnect: bool = Field(
        False,
        description="Reconnect a lost device, and one that comes late, every `open_retry_s`. "
        "Servos stay off.",
    )
    communication_timeout_s: Positive = Field(
        10.0, description="Time for the cyclic exchange to begin."
    )
    shutdown_s: NotNegative = Field(3.0, description="Time for an orderly end, all of it.")
    stale_after_s: Positive = Field(
        0.1, description="Age at which readings are too old to be true: motion stops."
    )
    servo_timeout_s: Positive = Field(5.0, description="Time for a servo to report on or off.")
    homing_timeout_s: Positive = Field(30.0, description="Time for an axis to find its home.")


class TrajectorySettings(Section):
    """Conditions for a trajectory to be accepted and to count as finished."""

    max_points: int = Field(3000, ge=1, description="Points in one trajectory.")
    velocity_margin: float = Field(
        0.10, ge=0, le=1, description="Part by which a path may exceed velocity_rad_s."
    )
    acceleration_margin: NotNegative | None = Field(
        1.0,
        description="Part by which a path may exceed acceleration_rad_s2 between the points of a "
        "planner; null: reported, never rejected.",
    )
    allow_partial_joints_goal: bool = Field(
        True, description="Accept goals of some of the joints; the others must be at rest."
    )
    allow_nonzero_velocity_at_trajectory_end: bool = Field(
        False,
        description="Accept a last point with a velocity: the joints pass it, and brake to rest"
        " after it unless another goal or stream takes over.",
    )
    start_tolerance_rad: Positive = Field(
        0.01, description="Distance from the present position of a first point at time 0."
    )
    start_tolerance_m: Positive = Field(0.002, description="The same of a prismatic joint.")
    goal_tolerance_rad: Positive = Field(0.01, description="Error at the end that is success.")
    goal_tolerance_m: Positive = Field(0.001, description="The same of a prismatic joint.")
    goal_time_s: Positive = Field(2.0, description="Time after the end to reach the goal.")
    path_tolerance_rad: Positive | None = Field(
        0.2,
        description="Error on the way that aborts; null watches nothing."
        " A position loop of gain 20/s without feed-forward lags 0.16 rad at 3.14 rad/s.",
    )
    path_tolerance_m: Positive | None = Field(
        0.1,
        description="The same of a prismatic joint."
        " A position loop of gain 20/s without feed-forward lags 0.05 m at 1 m/s.",
    )
    stopped_velocity_rad_s: Positive = Field(
        0.01, description="Speed below which a joint stands still."
    )
    stopped_velocity_m_s: Positive = Field(0.005, description="The same of a prismatic joint.")


def _count_axes(data: dict[str, Any]) -> int:
    drive: DriveSettings | None = data.get("drive")
    axes = [joint.axis for joint in data.get("joints", ())]
    return 1 + max([*axes, *(drive.axes if drive else ())], default=-1)


class StreamSettings(Section):
    """Motion that a client decides while it happens: streams, jogs and commands on topics."""

    timeout_s: Positive = Field(
        0.1, description="Age of the last command at which the joints slow to rest."
    )
    takeover: bool = Field(
        False,
        description="Streams and trajectories take joints in motion from each other; false: the "
        "second is rejected, with the owner's name.",
    )


class RobotDescriptor(Section):
    """One robot: what moves it, its nodes and their parameters, its backends."""

    schema_version: Literal[1] = Field(alias="schema", description="Version of this format: 1.")
    name: Name = Field(description="Short name, the same as the folder's.")
    summary: str = Field("", description="One line for `robotd robots`.")
    backend: str = Field("sim", description="Backend that is used when none is asked for.")
    cycle: CycleSettings = Field(CycleSettings(), description="Cycle of the control loop.")
    engine: EngineSettings = Field(EngineSettings(), description="Times of start-up and shut-down.")
    parameters_file: File | None = Field(
        None,
        description="File of parameters for the backend, relative to this file; null loads none.",
    )
    urdf: File | None = Field(None, description="URDF of the robot, relative to this file.")
    tool_link: str | None = Field(
        None,
        description="Link of the URDF whose pose is that of the tool; null: the one that the last "
        "joint moves. With `groups` a key of each group.",
    )
    joints: tuple[JointSettings, ...] = Field(
        (), strict=False, description="Joints in the order of JointState; switched on at start."
    )
    groups: dict[Name, GroupSettings] = Field(
        {},
        description="Groups of joints that move independently of each other, by name; empty: all "
        "joints are one group.",
    )
    drive: Drive | None = Field(
        None, description="Wheels of a mobile base, switched on at start; null: no base."
    )
    axes: int = Field(
        default_factory=_count_axes,
        ge=1,
        le=MAX_AXES,
        description="Axes of the device in use, 0 to axes - 1; by default the highest of a "
        "joint or wheel, plus 1.",
    )
    inputs: IoNames = Field(
        {}, description="Names of input bits: `part_present: 0.3` is byte 0, bit 3."
    )
    outputs: IoNames = Field({}, description="Names of output bits, as `inputs`.")
    gripper: GripperSettings | None = Field(
        None, description="Gripper on an output bit; null when there is none."
    )
    servo_grippers: dict[Name, ServoGripperSettings] = Field(
        {}, description="Grippers that are a joint, by name."
    )
    stop_input: StopInputSettings | None = Field(
        None, description="Input that stops all motion until a reset; null when there is none."
    )
    trajectory: TrajectorySettings = Field(
        TrajectorySettings(), description="Rules for trajectories."
    )
    stream: StreamSettings = Field(StreamSettings(), description="Streams and jogs.")
    nodes: tuple[str, ...] = Field(
        (), strict=False, description="ROS nodes that are started, by name."
    )
    ros_parameters: dict[str, dict[str, RosValue]] = Field(
        {}, description="Node, parameter and its default; `--params-file` and `-p` win."
    )
    backends: dict[str, Options] = Field(
        {}, description="Options of each backend, checked by the backend itself."
    )
    default_variant: str | None = Field(
        None, description="Variant when none is asked for; null is this file without a variant."
    )
    variants: dict[str, dict[str, Any]] = Field(
        {}, description="Changes to this file, by name of the deployment."
    )

    _tree: YamlNode | None = PrivateAttr(None)
    _variant: str | None = PrivateAttr(None)
    _settings: Mapping[type[BaseModel], BaseModel] = PrivateAttr(default_factory=dict)
    _read: set[type[BaseModel]] = PrivateAttr(default_factory=set)

    def of(
        self,
        tree: YamlNode,
        variant: str | None,
        settings: Mapping[type[BaseModel], BaseModel] | None = None,
    ) -> Self:
        """Set its origin: merged tree, applied variant, settings of features; return itself."""
        self._tree, self._variant, self._settings = tree, variant, settings or {}
        return self

    def settings(self, model: type[Settings]) -> Settings:
        """Return the settings of a feature, by its model; the defaults where there are none."""
        self._read.add(model)
        found = self._settings.get(model)
        return found if isinstance(found, model) else model()

    @property
    def unread_keys(self) -> tuple[str, ...]:
        """Keys of features that the file sets and nothing in this process has read."""
        given = self._tree.value if self._tree is not None else {}
        unread = [
            model
            for model in self._settings
            if model not in self._read and not getattr(model, "on_request", False)
        ]
        keys = [key for model in unread for key in model.model_fields]
        return tuple(key for key in keys if key in given and given[key].value is not None)

    def problem(self, key: str, text: str) -> DescriptorError:
        """Return an error of a key, dotted, with the line of the file that it comes from."""
        node = self._tree.find(key.split(".")) if self._tree is not None else None
        path, line = (node.path, node.line) if node else (None, None)
        return DescriptorError(text, path=path, line=line, key=key)

    def with_options(
        self, backend: str, options: Mapping[str, Any], origin: YamlNode | None
    ) -> Self:
        """Return a copy with ``options`` laid over the section of a backend.

        ``origin``: their tree, which errors name; None for options of a program.
        """
        section = {**self.backends.get(backend, {}), **options}
        copy = self.model_copy(update={"backends": {**self.backends, backend: section}})
        if self._tree is not None and origin is not None:
            # Without lines: a value with a line is taken for one of a robot that this one extends.
            keys = {key: replace(node, line=None) for key, node in origin.value.items()}
            backends = YamlNode({backend: replace(origin, value=keys)}, origin.path, None)
            merged = merge(self._tree, YamlNode({"backends": backends}, origin.path, None))
            copy._tree = replace(self._tree, value=merged.value)  # noqa: SLF001 - of the same class
        return copy

    @property
    def tree(self) -> YamlNode | None:
        """Origin of each key; None for a descriptor made in Python."""
        return self._tree

    @property
    def path(self) -> Path | None:
        """The file; None for a descriptor that was made in Python."""
        return None if self._tree is None else self._tree.path

    def names_any(self, keys: Iterable[str]) -> bool:
        """Return whether the file, or what replaces its values, has one of these top-level keys.

        True for a descriptor that was made in Python: what it was given is not known.
        """
        return self._tree is None or any(key in self._tree.value for key in keys)

    @property
    def variant(self) -> str | None:
        """The variant that was applied; None when the file is used unchanged."""
        return self._variant

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the arm's joints, without the gripper's."""
        return tuple(joint.name for joint in self.joints)

    @property
    def tool_links(self) -> dict[str, str]:
        """Links that are named as tools, by group; without ``groups`` by ``ALL_JOINTS``."""
        links = {name: group.tool_link for name, group in self.groups.items()}
        links = links or {ALL_JOINTS: self.tool_link}
        return {name: link for name, link in links.items() if link is not None}

    @property
    def joint_groups(self) -> dict[str, tuple[JointSettings, ...]]:
        """Joints of each group; without ``groups`` the only one is ``ALL_JOINTS``."""
        joints = {joint.name: joint for joint in self.joints}
        return {
            name: tuple(joints[joint] for joint in group.joints)
            for name, group in self.groups.items()
        } or {ALL_JOINTS: self.joints}

    @property
    def stop_decelerations(self) -> tuple[float | None, ...]:
        """Ramp of a controlled stop of each axis, rad/s² or m/s².

        None: it is neither a joint nor a wheel.
        """
        ramps = {joint.axis: joint.acceleration for joint in self.joints}
        if self.drive:
            ramps |= dict.fromkeys(self.drive.axes, self.drive.wheel_deceleration)
            ramps |= {wheel.axis: wheel.acceleration_rad_s2 for wheel in self.drive.steering}
        return tuple(ramps.get(axis) for axis in range(self.axes))

    def problems(self) -> Iterator[Problem]:
        if self.axes == 0:  # the default of a robot of bare axes, which pydantic does not check
            yield ("axes",), "missing: no joint says how many axes there are", self.axes
        yield from self._drive_problems()
        for key, names in (("inputs", self.inputs), ("outputs", self.outputs)):
            yield from twice(key, ((name, str(address)) for name, address in names.items()))
        yield from self._gripper_problems()
        for index, joint in enumerate(self.joints):
            if joint.axis >= self.axes:
                what = f"must be less than axes ({self.axes})"
                yield ("joints", index, "axis"), what, joint.axis
        yield from servo_gripper_problems(self.servo_grippers, self.joints)
        yield from twice("joints", enumerate(self.joint_names), "name")
        yield from twice("joints", enumerate(joint.axis for joint in self.joints), "axis")
        yield from group_problems(self.groups, self.joint_names)
        if self.groups and self.tool_link is not None:
            what = f"belongs into a group ({', '.join(self.groups)})"
            yield ("tool_link",), what, self.tool_link
        yield from twice("nodes", enumerate(self.nodes))
        for node in self.ros_parameters:
            if node not in self.nodes:
                yield ("ros_parameters", node), f"not in nodes ({', '.join(self.nodes)})", node
        if self.default_variant is not None and self.default_variant not in self.variants:
            known = ", ".join(self.variants) or "none"
            yield (
                ("default_variant",),
                f"unknown variant (available: {known})",
                self.default_variant,
            )

    def _drive_problems(self) -> Iterator[Problem]:
        joints = {joint.axis: index for index, joint in enumerate(self.joints)}
        drive = self.drive
        for key, axis in drive.keyed_axes if drive else ():
            if axis >= self.axes:
                yield ("drive", *key), f"must be less than axes ({self.axes})", axis
            if axis in joints:
                yield ("drive", *key), f"used before, by joints.{joints[axis]}.axis", axis

    def _gripper_problems(self) -> Iterator[Problem]:
        if self.gripper is None:
            return
        for index, joint in enumerate(self.gripper.joints):
            if joint in self.joint_names:
                yield ("gripper", "joints", index), "is a joint of the arm already", joint
        valve = IoAddress(self.gripper.output_byte, self.gripper.output_bit)
        for name, address in self.outputs.items():
            if address == valve:
                yield ("outputs", name), "is the output of the gripper", str(address)


def own_keys() -> frozenset[str]:
    """Return the keys at the top level of a robot's file that no feature can have."""
    fields = RobotDescriptor.model_fields.items()
    return frozenset({"extends", *(field.alias or name for name, field in fields)})
