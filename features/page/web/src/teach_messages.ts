// Messages of the panel "Teach"; features/teach/robotd_teach/page_*.py makes and takes them.

import type { Answer, Command, Seen } from "./control_messages";

export interface TeachDescription {
  groups: string[]; // of joints
  folder: string; // of the programs, on the robot's computer
  guides: boolean; // joints can be guided by hand
  falls: boolean; // an arm that is guided has no torque
}

export interface TaughtPose {
  joints: Record<string, number>; // rad or m
  problem: string; // why it cannot be gone to; "": nothing is known
}

export interface TaughtPath {
  joints: string[];
  duration_s: number;
  points: number;
  problem: string;
}

export interface ProgramRun {
  state: "none" | "running" | "paused" | "waiting" | "stopped" | "done";
  name: string; // of the program; "": it is not in the folder
  file: string;
  step: number; // from 1; 0: before the first
  steps: number;
  executed: number;
  progress: number; // 0 to 1 of the step's motion
  key: string; // of the step in the file
  line: number;
  text: string;
  message: string; // for the operator
  reason: string; // why it has stopped
}

export interface TeachState {
  poses: { error: string; poses: Record<string, TaughtPose> };
  paths: Record<string, TaughtPath>;
  programs: Record<string, string>; // versions of the files, by name
  recording: { name: string; duration_s: number; reason: string } | null;
  run: ProgramRun;
}

// Row of a program: a step, or a heading without keys.
export interface ProgramRow {
  text: string;
  depth: number;
  line: number | null;
  keys: (string | number)[]; // of its place in the file
  part?: boolean; // segment of the sequence above it
  key?: string; // as in ``ProgramRun``
  numbers?: Partial<Record<NumberKey, number | null>>; // that can be edited; null: the file has none
  posed?: boolean; // its target can be the present pose
  before?: boolean; // there are steps before it
  after?: boolean;
}

export interface Problem {
  line: number | null;
  text: string;
}

export interface ShownProgram {
  version: string;
  speed: number;
  rows: ProgramRow[];
  problems: Problem[];
}

// Motion to a pose or along a path; rows are positions of the joints on the way.
export interface Preview {
  joints: string[];
  start: number[];
  rows: number[][];
  approach: number; // of the rows, that only lead to the start of a path
  text: string;
}

export interface PreviewChoice {
  kind: Kind;
  name: string;
  speed: number;
  reverse: boolean;
  begin: number; // part of the path's time that is left out
}

export type Kind = "pose" | "path";
export type NumberKey = "speed" | "blend_m";
export type TeachBeat =
  | ({ type: "play"; start: number[] } & PreviewChoice)
  | { type: "guide"; group: string; held: boolean };
export type TeachCommand =
  | { type: "pose_save" | "path_begin"; name: string; group: string; replace: boolean }
  | { type: "rename"; kind: Kind; name: string; new_name: string }
  | { type: "delete"; kind: Kind; name: string }
  | { type: "path_end" | "program_pause" | "program_stop" }
  | ({ type: "preview" } & PreviewChoice)
  | { type: "program_show" | "program_check" | "program_resume"; name: string }
  | { type: "program_new"; name: string; group: string }
  | { type: "program_run"; name: string; single: boolean; seen: Seen | null } // as it was pressed
  | {
      type: "program_edit";
      name: string;
      version: string;
      keys: (string | number)[];
      edit: "up" | "down" | "delete" | "pose" | "add" | NumberKey;
      value?: number | null;
    };

// Names of the commands in answers.
export const TEACH_NAMES: Record<string, string> = {
  pose_save: "Save pose",
  path_begin: "Record",
  path_end: "End of recording",
  program_new: "New program",
  program_edit: "Edit",
  program_run: "Program",
  program_resume: "Program",
  program_pause: "Pause",
  program_stop: "Stop of the program",
};

export type Then = (answer: Answer) => void;

export interface Sender {
  send(command: Command, then?: Then): void;
  ask(command: Command, then: Then): void; // what changes nothing
  seen(): Seen | null; // what the page shows now
}
