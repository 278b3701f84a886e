// Joint groups that can be folded: a robot with many joints begins with their names alone.

import { make } from "./dom";
import type { AxisDescription } from "./messages";

const MANY = 12; // joints that are shown without folding

export interface AxisGroup {
  name: string; // "" for axes in no group
  axes: number[]; // indexes
}

// Divide axes into groups, in the order of their first axes.
export function groupsOf(axes: AxisDescription[], shown: (axis: AxisDescription) => boolean = () => true): AxisGroup[] {
  const groups = new Map<string, AxisGroup>();
  axes.forEach((axis, index) => {
    if (!shown(axis)) return;
    const group = groups.get(axis.group) ?? { name: axis.group, axes: [] };
    group.axes.push(index);
    groups.set(axis.group, group);
  });
  return [...groups.values()];
}

// Button that shows and hides the content of a group.
export class FoldButton {
  readonly element: HTMLButtonElement;

  constructor(
    { name, axes }: AxisGroup,
    total: number, // of joints: many begin folded
    private readonly show: (on: boolean) => void,
    ...more: HTMLElement[]
  ) {
    const count = `${axes.length} ${axes.length === 1 ? "joint" : "joints"}`;
    this.element = make("button", "fold", make("span", "", name || "others"), make("small", "", count), ...more);
    this.element.type = "button";
    this.element.addEventListener("click", () => this.open(!this.isOpen));
    this.open(total <= MANY);
  }

  get isOpen(): boolean {
    return this.element.getAttribute("aria-expanded") === "true";
  }

  open(on: boolean): void {
    this.element.setAttribute("aria-expanded", String(on));
    this.show(on);
  }
}
