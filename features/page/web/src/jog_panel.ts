// Panel that jogs joints: a row with two buttons for each, speed, and steps.

import { find, make, setClass, setText } from "./dom";
import { type AxisGroup, FoldButton, groupsOf } from "./folded_groups";
import type { Welcome } from "./control_messages";
import type { HeldButtons, Motion } from "./held_button";
import { nameElements } from "./joint_names";
import type { AxisDescription, Description, Sample, State } from "./messages";
import { hindranceOf, hindranceOfAxes, labelOf } from "./next_step";
import { signed, type Units } from "./units";

// Distance of a step, by unit of the joint; 0: as long as the button is held.
const STEPS: { rad: number; m: number; text: { rad: string; m: string } }[] = [
  { rad: 0, m: 0, text: { rad: "Hold", m: "Hold" } },
  { rad: Math.PI / 1800, m: 0.0001, text: { rad: "0.1°", m: "0.1 mm" } },
  { rad: Math.PI / 180, m: 0.001, text: { rad: "1°", m: "1 mm" } },
  { rad: Math.PI / 18, m: 0.01, text: { rad: "10°", m: "10 mm" } },
];

const MANY = 12; // joints that fit beside the other parts of the panel

export class JogPanel {
  private readonly slider = find<HTMLInputElement>("jog-speed");
  private readonly steps = find("jog-steps");
  private axes: AxisDescription[] = [];
  private velocities: Record<string, number> = {};
  private rows: { axis: number; position: HTMLElement; buttons: HTMLButtonElement[] }[] = [];
  private step = 0; // index of STEPS

  constructor(
    private readonly units: Units,
    private readonly held: HeldButtons,
  ) {
    this.slider.addEventListener("input", () => this.showSpeed());
  }

  open(welcome: Welcome, description: Description): void {
    this.axes = description.axes;
    this.velocities = welcome.jog_velocities;
    this.rows = [];
    const groups = groupsOf(this.axes, ({ name }) => name in this.velocities);
    const joints = groups.flatMap(({ axes }) => axes.map((axis) => this.axes[axis]!));
    find("jog").hidden = !joints.length;
    setClass(find("control-body"), "wide", joints.length > MANY);
    const names = nameElements(joints.map((joint) => joint.name));
    const lists = groups.map((group) => {
      const rows = group.axes.map((axis) => this.row(this.axes[axis]!, axis, names[joints.indexOf(this.axes[axis]!)]!));
      return groups.length > 1 ? [foldedRows(group, joints.length, rows)] : rows;
    });
    find("jog-rows").replaceChildren(...lists.flat());
    const units = [...new Set(joints.map((joint) => joint.unit as "rad" | "m"))];
    this.steps.replaceChildren(
      ...STEPS.map(({ text }, index) => {
        const words = [...new Set(units.map((unit) => text[unit]))].join(" · ");
        const button = make("button", "chip", words);
        button.type = "button";
        button.addEventListener("click", () => this.choose(index));
        return button;
      }),
    );
    this.choose(this.step);
  }

  // Disable what cannot move now, and say why.
  update(state: State): void {
    for (const { axis, buttons } of this.rows) {
      const reason = hindranceOfAxes(state, [axis])?.reason ?? "";
      for (const button of buttons) this.held.block(button, reason);
    }
    const isBlocked = this.rows.length > 0 && this.rows.every(({ buttons }) => buttons[0]!.title);
    const hindrance = isBlocked ? hindranceOf(state) : undefined;
    const next = hindrance?.button ? ` Next: ${labelOf(hindrance.button)}.` : "";
    find("jog-blocked").hidden = !hindrance;
    setText(find("jog-blocked"), hindrance ? `No joint can be jogged: ${hindrance.reason}.${next}` : "");
  }

  show(sample: Sample): void {
    for (const { axis, position } of this.rows) {
      const { unit } = this.axes[axis]!;
      const text = signed(sample.position(axis) * this.units.factor(unit), this.units.digits(unit));
      setText(position, `${text} ${this.units.name(unit)}`);
    }
    this.showSpeed();
  }

  private choose(step: number): void {
    this.step = step;
    [...this.steps.children].forEach((button, index) => button.setAttribute("aria-pressed", String(index === step)));
    setText(
      find("jog-hint"),
      step
        ? "One press moves one step. Leaving the window stops it."
        : "A joint moves while its button is held, also with Space or Enter. Letting go stops it.",
    );
  }

  private row(joint: AxisDescription, axis: number, name: HTMLElement): HTMLElement {
    const position = make("output", "number");
    const buttons = [-1, 1].map((sign) => {
      const button = make("button", "jog-button", sign < 0 ? "−" : "+");
      button.type = "button";
      button.setAttribute("aria-label", `${joint.name} ${sign < 0 ? "minus" : "plus"}`);
      this.held.add(button, () => this.motion(joint, sign));
      return button;
    });
    this.rows.push({ axis, position, buttons });
    const row = make("li", "jog-row", buttons[0]!, make("div", "joint", name, position), buttons[1]!);
    row.dataset["joint"] = joint.name;
    return row;
  }

  private motion(joint: AxisDescription, sign: number): Motion {
    const speed = (this.velocities[joint.name]! * Number(this.slider.value)) / 100;
    const distance = STEPS[this.step]![joint.unit as "rad" | "m"];
    return {
      name: joint.name,
      step: distance ? sign * distance : null,
      send: (link, hold, step) => link.jog(hold, joint.name, distance ? speed : sign * speed, step),
    };
  }

  // Velocities of the slider; one for each unit, of the fastest joint.
  private showSpeed(): void {
    const share = Number(this.slider.value) / 100;
    const units = [...new Set(this.rows.map(({ axis }) => this.axes[axis]!.unit))];
    const words = units.map((unit) => {
      const those = this.rows.map(({ axis }) => this.axes[axis]!).filter((axis) => axis.unit === unit);
      const highest = Math.max(...those.map((axis) => this.velocities[axis.name]!));
      const value = highest * share * this.units.factor(unit);
      return `${value.toFixed(this.units.name(unit) === "°" ? 1 : 3)} ${this.units.name(unit)}/s`;
    });
    setText(find("jog-speed-text"), words.join(", "));
  }
}

// The rows of a group below a button that folds them.
function foldedRows(group: AxisGroup, total: number, rows: HTMLElement[]): HTMLElement {
  const list = make("ul", "jog-grid", ...rows);
  const fold = new FoldButton(group, total, (on) => (list.hidden = !on));
  return make("li", "jog-group", fold.element, list);
}
