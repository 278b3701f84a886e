// Messages of the server; features/page/robotd_page makes them.

export const PROTOCOL = 2;

export interface AxisDescription {
  name: string;
  kind: "joint" | "wheel" | "axis";
  joint: string; // of the URDF, that the axis moves; "" for none
  group: string; // of joints; "" where the robot has one group
  unit: string;
  lower: number | null; // null: no limit
  upper: number | null;
  velocity: number | null;
  effort: number | null; // rated; null: not known
}

export interface Description {
  type: "description";
  protocol: number;
  robot: string;
  summary: string;
  variant: string;
  backend: string;
  version: string;
  namespace: string; // of its ROS nodes; "/" for none
  computer: string;
  simulated: boolean;
  time_scale: number | null; // null: as fast as possible
  rate_hz: number;
  wall_offset_s: number;
  axes: AxisDescription[];
  groups: string[]; // of joints, each with one goal at a time
  tools: { link: string; base: string }[]; // frame of each, and the root of the URDF
  fingers: { name: string; open: number; closed: number }[];
  inputs: number; // bytes
  outputs: number;
  io_names: Record<string, string>; // by address such as "in0.3"
  nodes: string[];
  urdf: string;
  urdf_file: string; // on the robot's computer
  meshes: Record<string, string>;
  has_control: boolean; // the page can be unlocked
  objects?: WorldObjects | null; // of a simulated world
  solids?: GuardedSolid[]; // that the arms keep away from
  cameras?: WorldCamera[]; // whose pictures the server has
}

export interface WorldCamera {
  name: string;
  width: number;
  height: number;
  rate_hz: number;
}

// Of each object; a pose is x, y, z in m and a quaternion x, y, z, w, in the link ``frame``.
export interface WorldObjects {
  frame: string;
  shapes: { name: string; shape: string; size: number[]; color: [number, number, number, number] }[];
  poses: number[][];
}

// The objects have moved.
export interface MovedObjects {
  type: "objects";
  poses: number[][];
}

// A body that an arm keeps away from, or that its tool carries; the pose is in the link ``frame``.
export interface GuardedSolid {
  name: string;
  shape: string;
  size: number[];
  pose: number[];
  frame: string;
}

// The scene has changed.
export interface ChangedScene {
  type: "scene";
  solids: GuardedSolid[];
}

export interface Problem {
  kind: string;
  is_fault: boolean;
  text: string;
  axes: string[];
  code: number;
  remedy: string;
  since_s: number;
}

export interface AxisState {
  servo: boolean;
  offline: boolean;
  fault: string;
  mode: string;
  operation: string;
  owner: string;
  switches: string[];
}

export interface Goal {
  duration_s: number;
  joints: string[];
  sender: string;
  ending: string;
}

export interface BusNode {
  id: number;
  state: string;
  offline: boolean;
  error_code: number;
  axes: number;
  inputs: number;
  outputs: number;
  fault: string;
}

export interface Bus {
  name: string;
  state: string;
  lost_frames: number;
  timeouts: number;
  late_cycles: number;
  note: string;
  details: Record<string, string>;
  nodes: BusNode[];
}

export interface State {
  type: "state";
  device: string;
  ready: boolean;
  problems: Problem[];
  speed: number;
  paused: boolean;
  axes: AxisState[];
  goals: (Goal | null)[]; // by group
  inputs: string; // hexadecimal; "" while not known
  outputs: string;
  buses: Bus[];
  missed: number;
  viewers: number;
  seen: number; // of the newest event that reduces motion: see ``Seen``
}

export interface RobotEvent {
  time_s: number;
  kind: string;
  subject: string;
  text: string;
  level: string;
  sender: string;
}

export interface Events {
  type: "events";
  events: RobotEvent[];
}

export type Message = Description | State | Events | MovedObjects | ChangedScene;

const HEADER = 6; // time, lateness, closed, x, y, heading
export const ROWS = 5; // position command, velocity command, position, velocity, torque

// Values of one moment; arrays have one number for each axis, NaN where it is not known.
export class Sample {
  constructor(
    readonly numbers: Float64Array,
    private readonly axes: number,
    private readonly groups: number,
  ) {}

  get time_s(): number {
    return this.numbers[0]!;
  }
  get late_s(): number {
    return this.numbers[1]!;
  }
  get closed(): number {
    return this.numbers[2]!;
  }
  goal_s(group: number): number {
    return this.numbers[HEADER + group]!;
  }
  get pose(): [number, number, number] {
    return [this.numbers[3]!, this.numbers[4]!, this.numbers[5]!];
  }
  positionCommand(axis: number): number {
    return this.row(0, axis);
  }
  get hasPositions(): boolean {
    for (let axis = 0; axis < this.axes; axis++) if (!Number.isFinite(this.position(axis))) return false;
    return true;
  }
  position(axis: number): number {
    return this.row(2, axis);
  }
  velocity(axis: number): number {
    return this.row(3, axis);
  }
  torque(axis: number): number {
    return this.row(4, axis);
  }
  followingError(axis: number): number {
    return this.positionCommand(axis) - this.position(axis);
  }

  // The robot looks the same: axes, base and gripper have not moved.
  looksLike(other: Sample): boolean {
    const first = HEADER + this.groups + 2 * this.axes;
    for (let index = 2; index < first + this.axes; index++) {
      if (index === HEADER) index = first; // from the pose to the positions
      if (!Object.is(this.numbers[index], other.numbers[index])) return false;
    }
    return true;
  }

  private row(row: number, axis: number): number {
    return this.numbers[HEADER + this.groups + row * this.axes + axis]!;
  }
}

// Samples of a binary message, one after the other.
export function* samplesOf(data: ArrayBuffer, axes: number, groups: number): Generator<Sample> {
  const numbers = new Float64Array(data);
  const width = HEADER + groups + ROWS * axes;
  for (let start = 0; start + width <= numbers.length; start += width) {
    yield new Sample(numbers.subarray(start, start + width), axes, groups);
  }
}
