// Motion to a pose or along a path: shown in the 3D view, and played from there.

import type { Answer } from "./control_messages";
import { find, setClass, setText } from "./dom";
import type { HeldButtons } from "./held_button";
import type { Description, Sample, State } from "./messages";
import { hindranceOfAxes } from "./next_step";
import type { Kind, Sender, Preview, PreviewChoice } from "./teach_messages";
import type { View } from "./view";

const DEFAULT_PERCENT: Record<Kind, number> = { pose: 20, path: 100 }; // as the commands
const MOVED = 0.005; // rad or m from where the shown motion begins
const AGAIN_MS = 1000; // between two questions while the arm moves

export class PreviewPanel {
  private readonly box = find("preview");
  private readonly text = find("preview-text");
  private readonly play = find<HTMLButtonElement>("preview-play");
  private readonly speed = find<HTMLInputElement>("preview-speed");
  private readonly begin = find<HTMLInputElement>("preview-begin");
  private readonly reverse = find<HTMLButtonElement>("preview-reverse");
  private description: Description | undefined;
  private chosen: { kind: Kind; name: string } | undefined;
  private shown: { choice: PreviewChoice; preview: Preview } | undefined;
  private obstacle = "";
  private hindrance = "";
  private asked = 0; // number of the newest question
  private asked_ms = 0;
  private isAsking = false;
  private commands = ""; // of the last sample

  constructor(
    private readonly view: View,
    private readonly held: HeldButtons,
    private readonly send: Sender["ask"],
  ) {
    for (const slider of [this.speed, this.begin]) {
      slider.addEventListener("input", () => this.showNumbers());
      slider.addEventListener("change", () => this.ask());
    }
    this.reverse.addEventListener("click", () => {
      this.reverse.setAttribute("aria-pressed", String(!this.isReverse));
      this.ask();
    });
    find("preview-stop").addEventListener("click", () => this.held.end("released"));
    find("preview-hide").addEventListener("click", () => this.hide());
    this.held.add(this.play, () => {
      const { choice, preview } = this.shown!;
      const { start } = preview;
      return { name: choice.name, step: 1, send: (link, hold) => link.teach(hold, { type: "play", start, ...choice }) };
    });
  }

  open(description: Description): void {
    this.description = description;
  }

  // Preview the motion to a pose or path from where the arm is; nothing moves.
  choose(kind: Kind, name: string): void {
    this.chosen = { kind, name };
    this.speed.value = String(DEFAULT_PERCENT[kind]);
    this.begin.value = "0";
    this.reverse.setAttribute("aria-pressed", "false");
    for (const id of ["preview-begin-box", "preview-reverse", "preview-approach"]) find(id).hidden = kind === "pose";
    setText(this.play, kind === "pose" ? "Go" : "Play");
    setText(find("preview-name"), name);
    this.box.hidden = false;
    this.showNumbers();
    this.ask();
    find("view").scrollIntoView({ block: "nearest" });
  }

  hide(): void {
    this.chosen = this.shown = undefined;
    this.isAsking = false;
    this.asked += 1;
    this.box.hidden = true;
    this.view.showPreview(undefined);
  }

  update(state: State): void {
    const joints = this.shown?.preview.joints ?? [];
    const axes = this.description?.axes.flatMap(({ name }, axis) => (joints.includes(name) ? [axis] : [])) ?? [];
    this.hindrance = hindranceOfAxes(state, axes)?.reason ?? "";
    this.block();
  }

  // Ask again once the arm rests elsewhere than where the shown motion begins.
  follow(sample: Sample): void {
    if (!this.chosen || this.isAsking || this.play.classList.contains("held")) return;
    const commands = this.description!.axes.map((_, axis) => sample.positionCommand(axis)).join();
    const isMoving = commands !== this.commands;
    this.commands = commands;
    if (isMoving || performance.now() - this.asked_ms < AGAIN_MS) return;
    if (this.obstacle || this.hasMoved(sample)) this.ask();
  }

  private hasMoved(sample: Sample): boolean {
    const { joints, start } = this.shown!.preview;
    return this.description!.axes.some(({ name }, axis) => {
      const index = joints.indexOf(name);
      return index >= 0 && Math.abs(sample.positionCommand(axis) - start[index]!) > MOVED;
    });
  }

  private ask(): void {
    const choice: PreviewChoice = {
      ...this.chosen!,
      speed: Number(this.speed.value) / 100,
      reverse: this.isReverse,
      begin: Number(this.begin.value) / 100,
    };
    this.asked += 1;
    this.asked_ms = performance.now();
    const number = this.asked;
    this.isAsking = true;
    this.obstacle = "the motion is being planned";
    this.block();
    this.send({ type: "preview", ...choice }, (answer) => {
      if (number === this.asked) this.showAnswer(choice, answer);
    });
  }

  private showAnswer(choice: PreviewChoice, { ok, text, data }: Answer): void {
    this.isAsking = false;
    this.obstacle = ok ? "" : text;
    if (ok) {
      const preview = data as Preview;
      this.shown = { choice, preview };
      this.view.showPreview(preview);
    }
    setText(this.text, ok ? this.shown!.preview.text : text);
    setClass(this.text, "unreachable", !ok);
    this.block();
  }

  private get isReverse(): boolean {
    return this.reverse.getAttribute("aria-pressed") === "true";
  }

  private block(): void {
    this.held.block(this.play, this.hindrance || this.obstacle);
  }

  private showNumbers(): void {
    setText(find("preview-speed-text"), `${this.speed.value} %`);
    setText(find("preview-begin-text"), `${this.begin.value} %`);
  }
}
