// Panel that jogs the tool: two buttons for each axis of a frame, and the speed.

import type { JoggedTool, Welcome } from "./control_messages";
import { find, make, setText } from "./dom";
import type { HeldButtons, Motion } from "./held_button";
import type { State } from "./messages";
import { hindranceOfAxes, labelOf } from "./next_step";
import type { Units } from "./units";

const AXES = ["x", "y", "z", "roll", "pitch", "yaw"]; // the first three are linear
const HINT = "The tool moves while a button is held, also with Space or Enter. Letting go stops it.";

export type Frame = "base" | "tool";

export class ToolJogPanel {
  private readonly slider = find<HTMLInputElement>("tool-speed");
  private readonly hint = find("tool-hint");
  private readonly frames = find("tool-frames");
  private readonly links = find("tool-links");
  private readonly buttons: HTMLButtonElement[] = [];
  private tools: JoggedTool[] = [];
  tool: JoggedTool | undefined; // the chosen one
  private state: State | undefined;
  frame: Frame = "base";

  constructor(
    private readonly units: Units,
    private readonly held: HeldButtons,
    private readonly onChoice: () => void, // of another tool or frame
  ) {
    this.slider.addEventListener("input", () => this.showSpeed());
    find("tool-rows").append(...AXES.map((name, axis) => this.row(name, axis)));
    for (const frame of ["base", "tool"] as const) {
      this.frames.append(chip(frame === "base" ? "Base" : "Tool", () => this.chooseFrame(frame)));
    }
  }

  open({ tools }: Welcome): void {
    this.tools = tools;
    find("tool-jog").hidden = !tools.length;
    this.links.hidden = tools.length < 2;
    this.links.replaceChildren(...tools.map((tool) => chip(tool.link, () => this.choose(tool))));
    if (tools[0]) this.choose(tools.find(({ group }) => group === this.tool?.group) ?? tools[0]);
    this.chooseFrame(this.frame);
  }

  // Disable what cannot move now, and say why.
  update(state: State): void {
    this.state = state;
    if (!this.tool) return;
    const hindrance = hindranceOfAxes(state, this.tool.axes);
    const next = hindrance?.button ? ` Next: ${labelOf(hindrance.button)}.` : "";
    for (const button of this.buttons) this.held.block(button, hindrance?.reason ?? "");
    find("tool-blocked").hidden = !hindrance;
    setText(find("tool-blocked"), hindrance ? `The tool cannot be moved: ${hindrance.reason}.${next}` : "");
  }

  // Of the slider, m/s.
  get velocity(): number {
    return this.share() * (this.tool?.linear ?? 0);
  }

  // Why the tool is slower than commanded; "": it is not.
  showSlow(reason: string): void {
    setText(this.hint, reason ? `Slower: ${reason}.` : HINT);
    this.hint.classList.toggle("slow", reason !== "");
  }

  showSpeed(): void {
    if (!this.tool) return;
    const share = this.share();
    const angular = share * this.tool.angular * this.units.factor("rad");
    const digits = this.units.name("rad") === "°" ? 1 : 2;
    setText(find("tool-speed-text"), `${(share * this.tool.linear).toFixed(3)} m/s, ${angular.toFixed(digits)} ${this.units.name("rad")}/s`);
  }

  private choose(tool: JoggedTool): void {
    this.tool = tool;
    this.tools.forEach((each, index) => press(this.links.children[index]!, each === tool));
    this.showSlow("");
    this.showSpeed();
    if (this.state) this.update(this.state);
    this.onChoice();
  }

  private chooseFrame(frame: Frame): void {
    this.frame = frame;
    press(this.frames.children[0]!, frame === "base");
    press(this.frames.children[1]!, frame === "tool");
    this.onChoice();
  }

  private row(name: string, axis: number): HTMLElement {
    const buttons = [-1, 1].map((sign) => {
      const button = make("button", "jog-button", sign < 0 ? "−" : "+");
      button.type = "button";
      button.setAttribute("aria-label", `tool ${name} ${sign < 0 ? "minus" : "plus"}`);
      this.held.add(button, () => this.motion(name, axis, sign));
      return button;
    });
    this.buttons.push(...buttons);
    return make("li", "jog-row", buttons[0]!, make("div", "joint", make("b", "", name)), buttons[1]!);
  }

  private motion(name: string, axis: number, sign: number): Motion {
    const { group, linear, angular } = this.tool!;
    const speed = sign * this.share() * (axis < 3 ? linear : angular);
    const along = [0, 1, 2].map((index) => (index === axis % 3 ? speed : 0));
    const none = [0, 0, 0];
    const { frame } = this;
    return {
      name: `tool ${name}`,
      step: null,
      send: (link, hold) => link.jogTool(hold, group, frame, axis < 3 ? along : none, axis < 3 ? none : along),
    };
  }

  private share(): number {
    return Number(this.slider.value) / 100;
  }
}

function chip(text: string, choose: () => void): HTMLButtonElement {
  const button = make("button", "chip", text);
  button.type = "button";
  button.addEventListener("click", choose);
  return button;
}

function press(button: Element, on: boolean): void {
  button.setAttribute("aria-pressed", String(on));
}
