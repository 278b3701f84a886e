// Teaching: hand guiding, poses and paths by name; programs have a panel of their own.

import type { Welcome } from "./control_messages";
import { find, make, setText } from "./dom";
import type { HeldButtons } from "./held_button";
import type { State } from "./messages";
import { hindranceOf } from "./next_step";
import type { PreviewPanel } from "./preview_panel";
import { ProgramPanel } from "./program_panel";
import type { Kind, Sender, TaughtPath, TaughtPose, TeachDescription, TeachState } from "./teach_messages";
import { signed, type Units } from "./units";

const CONFIRM_MS = 4000; // to press "Delete" again

export class TeachPanel {
  private readonly group = find<HTMLSelectElement>("teach-group");
  private readonly guide = find<HTMLButtonElement>("guide-on");
  private readonly isHeld = find<HTMLInputElement>("guide-held");
  private readonly poseName = find<HTMLInputElement>("pose-name");
  private readonly pathName = find<HTMLInputElement>("path-name");
  private readonly programs: ProgramPanel;
  private description: TeachDescription | undefined;
  private state: Partial<TeachState> = {};
  private hindrance = "";

  constructor(
    private readonly units: Units,
    private readonly held: HeldButtons,
    private readonly preview: PreviewPanel,
    private readonly sender: Sender,
  ) {
    this.programs = new ProgramPanel(sender, () => this.group.value);
    held.add(this.guide, () => {
      const [group, isHeld] = [this.group.value, this.isHeld.checked];
      this.isHeld.checked = false; // each time anew
      return { name: "Guiding", step: null, send: (link, hold) => link.teach(hold, { type: "guide", group, held: isHeld }) };
    });
    this.isHeld.addEventListener("change", () => this.block());
    this.guide.addEventListener("blur", () => this.block());
    for (const input of [this.poseName, this.pathName]) input.addEventListener("input", () => this.showButtons());
    this.onSubmit("pose-form", () => {
      const name = this.poseName.value.trim();
      sender.send({ type: "pose_save", name, group: this.group.value, replace: name in this.poses }, ({ ok }) => {
        if (ok) this.poseName.value = "";
        this.showButtons();
      });
    });
    this.onSubmit("path-form", () => {
      if (this.state.recording) sender.send({ type: "path_end" }, ({ ok }) => ok && (this.pathName.value = ""));
      else {
        const name = this.pathName.value.trim();
        sender.send({ type: "path_begin", name, group: this.group.value, replace: name in (this.state.paths ?? {}) });
      }
    });
    find("degrees").addEventListener("click", () => this.showPoses());
  }

  open({ panel }: Welcome): void {
    find("teach").hidden = !panel;
    if (!panel) return;
    this.description = panel;
    this.state = {};
    this.group.replaceChildren(...panel.groups.map((name) => make("option", "", name)));
    find("teach-group-box").hidden = panel.groups.length < 2;
    find("guide").hidden = !panel.guides;
    find("guide-falls").hidden = !panel.falls;
    this.programs.open(panel);
    this.block();
  }

  close(): void {
    find("teach").hidden = true;
  }

  update(state: State): void {
    this.hindrance = hindranceOf(state)?.reason ?? "";
    this.programs.update(state);
    this.block();
  }

  // Parts of the state that have changed.
  show(state: Partial<TeachState>): void {
    this.state = { ...this.state, ...state };
    if (state.poses) this.showPoses();
    if (state.paths) this.showPaths(state.paths);
    if ("recording" in state) this.showRecording();
    if (state.programs) this.programs.list(state.programs);
    if (state.run) this.programs.follow(state.run);
    this.showButtons();
  }

  // A text without the folder of the programs.
  shortened(text: string): string {
    return this.programs.shortened(text);
  }

  private block(): void {
    const unheld = this.description?.falls && !this.isHeld.checked ? "tick that you hold the arm" : "";
    if (!this.guide.classList.contains("held")) this.held.block(this.guide, this.hindrance || unheld);
  }

  private get poses(): Record<string, TaughtPose> {
    return this.state.poses?.poses ?? {};
  }

  private showButtons(): void {
    const isTaken = this.poseName.value.trim() in this.poses;
    setText(find("pose-save"), isTaken ? "Replace by present pose" : "Save present pose");
    const isPath = this.pathName.value.trim() in (this.state.paths ?? {});
    setText(find("path-record"), this.state.recording ? "End and save" : isPath ? "Record anew" : "Record");
  }

  private showRecording(): void {
    const { recording } = this.state;
    find("path-recording").hidden = !recording;
    this.pathName.disabled = Boolean(recording);
    if (!recording) return;
    const { name, duration_s, reason } = recording;
    setText(find("path-recording"), `${name}: ${duration_s.toFixed(1)} s${reason ? `; ended: ${reason}` : " are recorded"}`);
  }

  private showPoses(): void {
    const error = this.state.poses?.error ?? "";
    setText(find("pose-error"), error);
    find("pose-error").hidden = !error;
    const [factor, digits] = [this.units.factor("rad"), this.units.name("rad") === "°" ? 1 : 3];
    find("pose-list").replaceChildren(
      ...Object.entries(this.poses).map(([name, { joints, problem }]) => {
        const values = Object.entries(joints).map(([joint, position]) => `${joint} ${signed(position * factor, digits)}`);
        return this.row("pose", name, values, problem);
      }),
    );
  }

  private showPaths(paths: Record<string, TaughtPath>): void {
    find("path-list").replaceChildren(
      ...Object.entries(paths).map(([name, { duration_s, points, problem }]) =>
        this.row("path", name, points ? [`${duration_s.toFixed(1)} s`, `${points} points`] : [], problem),
      ),
    );
  }

  private row(kind: Kind, name: string, values: string[], problem: string): HTMLElement {
    const show = button("Show", () => this.preview.choose(kind, name));
    show.disabled = problem !== "";
    const row = make("li", "", make("b", "", name));
    const rename = button("Rename", () => row.append(this.renaming(kind, name)));
    const remove = button("Delete", () => {
      if (remove.textContent === "Delete") {
        setText(remove, "Delete?");
        setTimeout(() => setText(remove, "Delete"), CONFIRM_MS);
      } else this.sender.send({ type: "delete", kind, name });
    });
    row.append(make("div", "line", show, rename, remove), make("span", "values number", ...values.map((value) => make("span", "", value))));
    if (problem) row.append(make("span", "problem", problem));
    return row;
  }

  private renaming(kind: Kind, name: string): HTMLFormElement {
    const input = make("input");
    input.value = name;
    input.required = true;
    input.setAttribute("aria-label", `new name of ${name}`);
    const form = make("form", "line", make("label", "field", input), button("OK", () => form.requestSubmit()), button("Cancel", () => form.remove()));
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.sender.send({ type: "rename", kind, name, new_name: input.value.trim() });
      form.remove();
    });
    setTimeout(() => input.select());
    return form;
  }

  private onSubmit(id: string, act: () => void): void {
    find<HTMLFormElement>(id).addEventListener("submit", (event) => {
      event.preventDefault();
      act();
    });
  }
}

export function button(text: string, press: () => void): HTMLButtonElement {
  const made = make("button", "action small", text);
  made.type = "button";
  made.addEventListener("click", press);
  return made;
}
