// Target of the tool: dragged in the 3D view, shown as a ghost, and moved to.

import type { ControlLink } from "./control_link";
import type { JoggedTool, Reached, Welcome } from "./control_messages";
import { find, setClass, setText } from "./dom";
import type { HeldButtons } from "./held_button";
import type { State } from "./messages";
import { hindranceOfAxes } from "./next_step";
import type { TargetGizmo } from "./target_gizmo";
import type { ToolJogPanel } from "./tool_jog_panel";
import type { View } from "./view";

const ASKING = "looking for a posture";

export class TargetPanel {
  private readonly toggle = find<HTMLButtonElement>("target-on");
  private readonly text = find("target-text");
  private readonly buttons: HTMLButtonElement[];
  private gizmo: TargetGizmo | undefined; // while a target is shown
  private hindrance = "";
  private obstacle = ""; // to the target
  private tool: JoggedTool | undefined; // of the last question
  private isAsking = false;
  private asksForTool = false; // the last question was where the tool is
  private wanted: { pose: number[] | null; isFinal: boolean } | undefined; // the next question

  constructor(
    private readonly view: View,
    private readonly link: ControlLink,
    private readonly held: HeldButtons,
    private readonly pad: ToolJogPanel,
  ) {
    this.toggle.addEventListener("click", () => (this.gizmo ? this.hide() : this.show()));
    find("target-shift").addEventListener("click", () => this.setMode("translate"));
    find("target-turn").addEventListener("click", () => this.setMode("rotate"));
    find("target-back").addEventListener("click", () => this.ask(null, true));
    this.buttons = [this.button("target-move", "Move", false), this.button("target-line", "Line", true)];
  }

  open({ tools }: Welcome): void {
    find("target").hidden = !tools.length;
    this.isAsking = false;
  }

  close(): void {
    this.hide();
    find("target").hidden = true;
  }

  update(state: State): void {
    this.hindrance = (this.pad.tool && hindranceOfAxes(state, this.pad.tool.axes)?.reason) ?? "";
    this.block();
  }

  // Another tool or frame was chosen in the pad.
  retarget(): void {
    if (this.pad.tool === this.tool) this.gizmo?.align(this.pad.frame);
    else if (this.gizmo) this.ask(null, true);
  }

  showReached({ pose, joints, text }: Reached): void {
    this.isAsking = false;
    if (this.gizmo) {
      this.obstacle = text;
      if (pose && this.asksForTool) this.gizmo.show(this.tool!.base, pose, this.pad.frame);
      this.gizmo.showPosture(joints);
      setText(this.text, text ? `Not reachable: ${text}.` : "Reachable. Move or Line goes there with the tool speed.");
      setClass(this.text, "unreachable", text !== "");
      this.block();
    }
    this.next();
  }

  private show(): void {
    this.gizmo = this.view.target();
    this.text.hidden = false;
    if (!this.gizmo) {
      setText(this.text, "The robot is not drawn: there is nothing to drag.");
      return;
    }
    this.gizmo.onDrag = (isFinal) => this.ask(this.gizmo!.pose, isFinal);
    this.setMode("translate");
    this.setOn(true);
    this.ask(null, true);
  }

  private hide(): void {
    this.gizmo?.hide();
    this.gizmo = this.wanted = undefined;
    this.setOn(false);
  }

  private setOn(on: boolean): void {
    this.toggle.setAttribute("aria-pressed", String(on));
    find("target-body").hidden = this.text.hidden = !on;
  }

  private setMode(mode: "translate" | "rotate"): void {
    this.gizmo?.setMode(mode);
    find("target-shift").setAttribute("aria-pressed", String(mode === "translate"));
    find("target-turn").setAttribute("aria-pressed", String(mode === "rotate"));
  }

  // Ask the robot for the posture; null: of where the tool is. One question at a time, then the newest.
  private ask(pose: number[] | null, isFinal: boolean): void {
    this.wanted = { pose, isFinal };
    this.next();
  }

  private next(): void {
    if (this.isAsking || !this.wanted || !this.pad.tool) return;
    const { pose, isFinal } = this.wanted;
    this.wanted = undefined;
    this.isAsking = true;
    this.asksForTool = pose === null;
    this.tool = this.pad.tool;
    this.obstacle = ASKING;
    this.block();
    this.link.reach(this.tool.group, pose, isFinal);
  }

  private button(id: string, name: string, line: boolean): HTMLButtonElement {
    const button = find<HTMLButtonElement>(id);
    this.held.add(button, () => {
      const { group } = this.pad.tool!;
      const pose = this.gizmo!.pose;
      const { velocity } = this.pad;
      return { name, step: 1, send: (link, hold) => link.moveTool(hold, group, pose, line, velocity) };
    });
    return button;
  }

  private block(): void {
    for (const button of this.buttons) this.held.block(button, this.hindrance || this.obstacle);
  }
}
