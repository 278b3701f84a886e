// Messages of the control side; features/page/robotd_page/control_server.py makes and takes them.

import type { TeachCommand, TeachDescription, TeachState } from "./teach_messages";

export interface FaultField {
  name: string;
  type: "integer" | "number" | "boolean";
  default: number | boolean | null;
  optional: boolean;
}

// Highest velocities of the base in m/s and rad/s, and its way to rest from the highest one ahead.
export interface Drive {
  release_s: number; // from the last heartbeat until it slows down
  rest_s: number;
  rest_m: number;
  linear: number;
  angular: number;
  motions: { name: string; linear: number; lateral: number; angular: number }[];
}

// Tool of a joint group, and its highest velocities in m/s and rad/s.
export interface JoggedTool {
  group: string;
  link: string;
  base: string;
  axes: number[];
  linear: number;
  angular: number;
}

export interface Welcome {
  type: "welcome";
  name: string; // of this page, as owner of joints
  heartbeat_ms: number;
  jog_velocities: Record<string, number>; // highest, by joint
  tools: JoggedTool[]; // empty where nothing moves a tool
  drive: Drive | null; // null: without a base
  gripper: boolean;
  outputs: Record<string, string>; // address such as "out0.3", by name
  output_bytes: number;
  faults: Record<string, FaultField[]>; // by kind; empty on hardware
  panel: TeachDescription | null; // null: nothing can be taught
}

export interface Answer {
  type: "answer";
  id: number;
  ok: boolean;
  text: string;
  data?: unknown; // of a question
}

export interface JogEnd {
  type: "jog";
  hold: number;
  ok: boolean;
  silent: boolean; // heartbeats came late, or none came
  text: string;
  remaining: number | null; // of a step or move that was not finished
  what: string; // "Jog" or "Move"
}

// Why the tool of a hold is slower than commanded; "": it is not.
export interface SlowReason {
  type: "slow";
  hold: number;
  text: string;
}

// Posture that reaches a target; matrices are of the tool in its base, column by column.
export interface Reached {
  type: "reach";
  id: number;
  pose: number[] | null; // null: the question has failed
  joints: Record<string, number> | null; // null: none reaches it
  text: string; // why not
}

export interface RequestError {
  type: "error";
  text: string;
}

// Parts of the panel's state that have changed.
export interface PanelMessage {
  type: "panel";
  state: Partial<TeachState>;
}

export type ControlMessage = Welcome | PanelMessage | Answer | JogEnd | SlowReason | Reached | RequestError;

// State that the page showed when a button was pressed: the robot rejects a command that came too late.
export interface Seen {
  events: number; // ``seen`` of its newest state
  time_s: number; // of its newest sample, on the robot's clock
}

export type Command =
  | { type: "stop" | "reset" | "recover" }
  | { type: "servos"; on: boolean }
  | { type: "gripper"; closed: boolean }
  | { type: "speed"; speed: number }
  | { type: "pause"; paused: boolean }
  | { type: "output"; name: string; value: boolean }
  | { type: "output_bit"; byte: number; bit: number; value: boolean }
  | { type: "output_byte"; byte: number; value: number }
  | TeachCommand
  | { type: "inject"; fault: Record<string, Record<string, number | boolean>> };

export type ReleaseReason = "released" | "window lost focus" | "tab hidden" | "page left" | "page stalled";
