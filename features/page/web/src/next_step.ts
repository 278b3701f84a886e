// What keeps axes from moving, and the button that helps.

import { find, setClass } from "./dom";
import type { AxisState, State } from "./messages";

export interface Hindrance {
  reason: string;
  button: string; // id; "" where no button helps
}

const RECOVER = "recover";
// Buttons by the kind of problem; kinds that are not here do not keep axes from moving.
const BUTTONS: Record<string, string> = {
  starting: "",
  ending: "",
  device: RECOVER,
  controller: RECOVER,
  alarm: RECOVER,
  offline: RECOVER,
  "servo off": "servos-on",
  stopped: "reset",
  paused: "pause",
};
const OF_ONE_AXIS = ["alarm", "offline", "servo off"];

// The first of all hindrances, of the robot or of an axis.
export function hindranceOf(state: State): Hindrance | undefined {
  return hindrances(state)[0];
}

// What keeps these axes from moving: a problem of another axis does not.
export function hindranceOfAxes(state: State, axes: number[]): Hindrance | undefined {
  const own = axes.map((axis) => state.axes[axis]).find((each) => each && axisReason(each));
  const ofRobot = hindrances(state, (kind) => !OF_ONE_AXIS.includes(kind));
  return ofRobot[0] ?? (own && { reason: axisReason(own), button: own.fault || own.offline ? RECOVER : "servos-on" });
}

export function labelOf(button: string): string {
  return find(button).textContent!;
}

// Mark the one button to press next.
export function highlight(button: string | undefined): void {
  for (const id of new Set(Object.values(BUTTONS))) {
    if (id) setClass(find(id), "next", id === button);
  }
}

// A remedy that names the buttons of the page instead of commands.
export function withButtons(remedy: string): string {
  return remedy
    .replace("robotd recover", "press Recover")
    .replace("robotd reset", "press Reset")
    .replace("robotd servo on", "press Servos on");
}

function hindrances({ problems, paused }: State, counts: (kind: string) => boolean = () => true): Hindrance[] {
  return problems
    .filter(({ kind }) => kind in BUTTONS && counts(kind))
    .map(({ kind, text }) => ({
      reason: text,
      button: kind === "paused" && !paused ? "" : BUTTONS[kind]!, // at speed 0 % the slider helps
    }));
}

function axisReason({ fault, offline, servo }: AxisState): string {
  return fault || (offline ? "does not answer" : servo ? "" : "servo is off");
}
