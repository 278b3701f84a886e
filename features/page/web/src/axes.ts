// Table of joints and other axes: values, limits as bars, servo, owner, faults.

import { axisColor } from "./colors";
import { find, make, setClass, setText } from "./dom";
import { type AxisGroup, FoldButton, groupsOf } from "./folded_groups";
import { nameElements } from "./joint_names";
import type { AxisDescription, AxisState, Description, Sample } from "./messages";
import { signed, type Units } from "./units";

const COLUMNS = 7;

// Head of a folded group.
interface Head {
  axes: number[];
  fold: FoldButton;
  lamp: HTMLElement;
}

interface Row {
  body: HTMLElement;
  position: HTMLElement;
  positionBar: Bar;
  velocity: HTMLElement;
  velocityBar: Bar;
  torque: HTMLElement;
  error: HTMLElement;
  servo: HTMLElement;
  state: HTMLElement;
  owner: HTMLElement;
  fault: HTMLElement;
}

const SWITCH_NAMES: Record<string, string> = {
  home_switch: "home switch",
  negative_limit: "negative limit switch",
  positive_limit: "positive limit switch",
};

export class AxesTable {
  private readonly table = find<HTMLTableElement>("axes");
  private description: Description | undefined;
  private rows: Row[] = [];
  private heads: Head[] = []; // empty where the robot has one group

  constructor(private readonly units: Units) {}

  describe(description: Description): void {
    this.description = description;
    for (const body of [...this.table.tBodies]) body.remove();
    const names = nameElements(description.axes.map((axis) => axis.name));
    this.rows = description.axes.map((axis, index) => this.row(axis, index, names[index]!));
    const groups = groupsOf(description.axes);
    this.heads = groups.length > 1 ? groups.map((group) => this.head(group)) : [];
    groups.forEach(({ axes }, group) => {
      const head = this.heads[group]?.fold.element;
      if (head) this.table.append(make("tbody", "group", make("tr", "", wide("th", head))));
      this.table.append(...axes.map((axis) => this.rows[axis]!.body));
    });
  }

  show(sample: Sample): void {
    this.rows.forEach((row, axis) => {
      const { unit, lower, upper, velocity } = this.description!.axes[axis]!;
      const factor = this.units.factor(unit);
      const name = this.units.name(unit);
      const digits = this.units.digits(unit);
      const value = (number: number, suffix = "", more = 0): string =>
        `${signed(number * factor, digits + more)} ${name}${suffix}`;
      setText(row.position, value(sample.position(axis)));
      setText(row.velocity, value(sample.velocity(axis), "/s", -1));
      setText(row.torque, `${signed(sample.torque(axis), 2)} ${unit === "m" ? "N" : "N·m"}`);
      setText(row.error, value(sample.followingError(axis), "", 1));
      row.positionBar.show(sample.position(axis), lower, upper);
      row.velocityBar.show(sample.velocity(axis), velocity === null ? null : -velocity, velocity);
    });
  }

  update(states: AxisState[]): void {
    for (const head of this.heads) showGroup(head, states);
    states.forEach((state, axis) => {
      const row = this.rows[axis];
      if (!row) return;
      setClass(row.body, "faulty", Boolean(state.fault));
      setText(row.servo, state.offline ? "offline" : state.servo ? "on" : "off");
      row.servo.className = `lamp ${state.offline ? "bad" : state.servo ? "good" : "idle"}`;
      setText(row.state, stateText(state));
      setText(row.owner, state.owner);
      setText(row.fault, state.fault);
      row.fault.parentElement!.parentElement!.hidden = !state.fault;
    });
  }

  private head(group: AxisGroup): Head {
    const lamp = make("span", "lamp idle");
    const show = (on: boolean): void => group.axes.forEach((axis) => (this.rows[axis]!.body.hidden = !on));
    return { axes: group.axes, lamp, fold: new FoldButton(group, this.rows.length, show, lamp) };
  }

  private row(axis: AxisDescription, index: number, nameElement: HTMLElement): Row {
    const name = make("th", "", swatch(index), nameElement);
    name.scope = "row";
    const cell = (label: string, ...children: Node[]): HTMLTableCellElement => {
      const made = make("td", "", ...children);
      made.dataset["label"] = label;
      return made;
    };
    const position = make("span", "number");
    const velocity = make("span", "number");
    const torque = make("span", "number");
    const error = make("span", "number");
    const servo = make("span", "lamp idle");
    const state = make("span", "state");
    const owner = make("span", "owner");
    const fault = make("span", "");
    const positionBar = new Bar(`position of ${axis.name} between its limits`);
    const velocityBar = new Bar(`velocity of ${axis.name} between its limits`);
    const row = make(
      "tr",
      "",
      name,
      cell("Servo", servo),
      cell("Position", position, positionBar.element),
      cell("Velocity", velocity, velocityBar.element),
      cell("Torque", torque),
      cell("Following error", error),
      cell("State", state, owner),
    );
    const faultRow = make("tr", "fault", wide("td", fault));
    faultRow.hidden = true;
    const body = make("tbody", "", row, faultRow);
    body.dataset["axis"] = axis.name;
    return { body, position, positionBar, velocity, velocityBar, torque, error, servo, state, owner, fault };
  }
}

// Bar from the lower to the upper limit, with a mark at the value.
class Bar {
  readonly element = make("span", "limits");
  private readonly mark = make("i");

  constructor(label: string) {
    this.element.setAttribute("role", "meter");
    this.element.setAttribute("aria-label", label);
    this.element.append(this.mark);
  }

  show(value: number, lower: number | null, upper: number | null): void {
    if (lower === null || upper === null) {
      this.element.classList.add("none");
      return;
    }
    const share = (value - lower) / (upper - lower);
    this.mark.style.left = `${100 * Math.min(Math.max(share, 0), 1)}%`;
    this.mark.hidden = !Number.isFinite(share);
    setClass(this.element, "near", share < 0.03 || share > 0.97);
    this.element.setAttribute("aria-valuemin", String(lower));
    this.element.setAttribute("aria-valuemax", String(upper));
    if (Number.isFinite(value)) this.element.setAttribute("aria-valuenow", value.toFixed(3));
  }
}

function wide<K extends "td" | "th">(tag: K, content: HTMLElement): HTMLTableCellElement {
  const cell = make(tag, "", content);
  cell.colSpan = COLUMNS;
  return cell;
}

// State of a group in one word; a fault unfolds it once.
function showGroup({ axes, fold, lamp }: Head, states: AxisState[]): void {
  const own = axes.map((axis) => states[axis]).filter((each) => each !== undefined);
  const on = own.filter((each) => each.servo).length;
  const isFaulty = own.some((each) => each.fault || each.offline);
  if (isFaulty && !lamp.classList.contains("bad")) fold.open(true);
  setText(lamp, isFaulty ? "fault" : on === own.length ? "on" : on ? `${on} on` : "off");
  lamp.className = `lamp ${isFaulty ? "bad" : on === own.length ? "good" : "idle"}`;
}

function swatch(axis: number): HTMLElement {
  const made = make("i", "swatch");
  made.style.background = axisColor(axis);
  return made;
}

function stateText(state: AxisState): string {
  const parts = [state.operation];
  if (state.mode !== "position") parts.push(`${state.mode} mode`);
  parts.push(...state.switches.map((name) => SWITCH_NAMES[name] ?? name));
  return parts.join(" · ");
}
