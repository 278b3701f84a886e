// Programs: the steps of a file, the running one, and edits that are saved back into the file.

import type { Answer } from "./control_messages";
import { find, make, setClass, setText } from "./dom";
import type { State } from "./messages";
import { hindranceOf } from "./next_step";
import { button } from "./teach_panel";
import type { NumberKey, Problem, ProgramRow, ProgramRun, Sender, ShownProgram, TeachCommand, TeachDescription } from "./teach_messages";

type Edit = Extract<TeachCommand, { type: "program_edit" }>["edit"];

const ACTIVE = ["running", "paused", "waiting"];
// A number as people write it: its label, and how many of it are one in the file.
const NUMBERS: Record<NumberKey, [string, number]> = { speed: ["Speed, %", 100], blend_m: ["Blend, mm", 1000] };

interface Shown {
  row: ProgramRow;
  item: HTMLElement;
  button: HTMLButtonElement;
}

export class ProgramPanel {
  private readonly file = find<HTMLSelectElement>("program-file");
  private readonly steps = find("program-steps");
  private readonly speed = find<HTMLInputElement>("program-speed");
  private readonly progress = make("progress");
  private versions: Record<string, string> = {};
  private program: ShownProgram | undefined;
  private shown: Shown[] = [];
  private selected = ""; // keys of a row
  private run: ProgramRun | undefined;
  private problems: Problem[] = []; // of the last check
  private checked = ""; // text of the last check
  private wanted = ""; // name of a program to be selected once it is listed
  private hindrance = "";
  private folder = "";

  constructor(
    private readonly sender: Sender,
    group: () => string,
  ) {
    this.file.addEventListener("change", () => this.load());
    find<HTMLFormElement>("program-form").addEventListener("submit", (event) => {
      event.preventDefault();
      const field = find<HTMLInputElement>("program-name");
      const name = field.value.trim();
      sender.send({ type: "program_new", name, group: group() }, ({ ok }) => {
        if (!ok) return;
        field.value = "";
        this.wanted = name;
      });
    });
    const { send } = sender;
    const press: Record<string, () => void> = {
      check: () => this.check(),
      run: () => this.start(false),
      step: () => this.start(true),
      pause: () => send({ type: "program_pause" }),
      resume: () => send({ type: "program_resume", name: this.name }),
      stop: () => send({ type: "program_stop" }),
    };
    for (const [name, act] of Object.entries(press)) find(`program-${name}`).addEventListener("click", act);
    this.speed.addEventListener("change", () => this.edit([], "speed", Number(this.speed.value) / 100));
    this.progress.max = 1;
  }

  open({ folder }: TeachDescription): void {
    this.folder = folder;
    setText(find("program-none"), `Programs are the files *.yaml in ${folder}.`);
  }

  // Programs of the folder, with their versions.
  list(versions: Record<string, string>): void {
    const selected = this.wanted in versions ? this.wanted : this.name;
    this.versions = versions;
    this.file.replaceChildren(...Object.keys(versions).map((name) => make("option", "", name)));
    if (selected in versions) this.file.value = selected;
    if (this.wanted in versions) this.wanted = "";
    find("program-body").hidden = !this.name;
    if (this.name && versions[this.name] !== this.program?.version) this.load();
  }

  update(state: State): void {
    this.hindrance = hindranceOf(state)?.reason ?? "";
    this.block();
  }

  // State of the newest program.
  follow(run: ProgramRun): void {
    const isNew = !this.run || (!ACTIVE.includes(this.run.state) && ACTIVE.includes(run.state));
    if (run.state !== this.run?.state) this.checked = "";
    this.run = run;
    if (isNew && ACTIVE.includes(run.state) && run.name in this.versions && run.name !== this.name) {
      this.file.value = run.name;
      this.load();
    }
    this.mark();
  }

  private get name(): string {
    return this.file.value;
  }

  private get isActive(): boolean {
    return ACTIVE.includes(this.run?.state ?? "none");
  }

  private load(): void {
    const { name } = this;
    this.sender.ask({ type: "program_show", name }, ({ ok, text, data }: Answer) => {
      if (name !== this.name) return;
      this.program = ok ? (data as ShownProgram) : undefined;
      this.problems = ok ? this.program!.problems : [{ line: null, text }];
      this.checked = "";
      this.build();
    });
  }

  private check(passed: () => void = () => {}): void {
    const { name } = this;
    this.checked = "is being checked";
    this.mark();
    this.sender.ask({ type: "program_check", name }, ({ ok, text, data }: Answer) => {
      if (name !== this.name) return;
      const found = ok ? (data as { problems: Problem[]; text: string }) : { problems: [{ line: null, text }], text: "" };
      this.problems = found.problems;
      this.checked = found.text;
      this.mark();
      if (!found.problems.length) passed();
    });
  }

  // A program is checked, by line and key, before it begins; a step after others is not.
  private start(single: boolean): void {
    const { name } = this;
    const seen = this.sender.seen();
    const run = (): void => this.sender.send({ type: "program_run", name, single, seen });
    if (single && this.run?.state === "stopped" && this.run.name === name) run();
    else this.check(run);
  }

  private edit(keys: (string | number)[], edit: Edit, value: number | null = null): void {
    const { version } = this.program!;
    this.sender.send({ type: "program_edit", name: this.name, version, keys, edit, value }, ({ ok }) => {
      if (ok && (edit === "up" || edit === "down")) this.selected = moved(keys, edit);
      this.load();
    });
  }

  private build(): void {
    this.speed.value = this.program ? String(Math.round(100 * this.program.speed)) : "";
    this.speed.disabled = !this.program?.rows.length;
    this.shown = (this.program?.rows ?? []).map((row) => this.row(row));
    this.steps.replaceChildren(...this.shown.map(({ item }) => item));
    this.steps.hidden = !this.shown.length;
    this.mark();
  }

  private row(row: ProgramRow): Shown {
    const text = make("span", "text", row.text);
    text.style.setProperty("--depth", String(row.depth));
    const kind = row.part ? " part" : row.keys.length ? "" : " heading";
    const made = make("button", `step${kind}`, make("span", "line-number", String(row.line ?? "")), text);
    made.type = "button";
    const item = make("li", "", made);
    const place = placeOf(row);
    if (place) {
      made.addEventListener("click", () => {
        this.selected = this.selected === place ? "" : place;
        this.build();
      });
      made.setAttribute("aria-expanded", String(this.selected === place));
      if (this.selected === place) item.append(this.editor(row));
    }
    return { row, item, button: made };
  }

  private editor({ keys, numbers, posed, before, after }: ProgramRow): HTMLElement {
    const act = (text: string, edit: Edit, isPossible = true): HTMLButtonElement => {
      const made = button(text, () => this.edit(keys, edit));
      made.disabled = !isPossible;
      return made;
    };
    const fields = (Object.entries(numbers ?? {}) as [NumberKey, number | null][]).map(([key, value]) => {
      const [label, scale] = NUMBERS[key];
      const input = make("input");
      input.type = "number";
      input.min = "0";
      input.step = "any";
      input.value = value === null ? "" : String(Number((value * scale).toFixed(3)));
      if (key === "speed") input.placeholder = this.speed.value;
      input.addEventListener("change", () => this.edit(keys, key, input.value === "" ? null : Number(input.value) / scale));
      return make("label", "field", make("span", "", label), input);
    });
    const pose = posed ? [act("Take present pose", "pose")] : [];
    return make("div", "edit", act("Up", "up", before), act("Down", "down", after), ...fields, ...pose, act("Add present pose", "add"), act("Delete", "delete", before || after));
  }

  // Mark the running step and those with problems, and say how the program is.
  private mark(): void {
    this.block();
    const { run } = this;
    const isShown = run !== undefined && run.name === this.name && run.name !== "";
    const look = !isShown || run.state === "done" ? "" : run.state === "stopped" ? "stopped" : "running";
    this.progress.remove();
    for (const { row, item, button: made } of this.shown) {
      const isHere = look !== "" && row.key !== undefined && row.key === run!.key;
      const wasHere = made.classList.contains("running") || made.classList.contains("stopped");
      setClass(made, "running", isHere && look === "running");
      setClass(made, "stopped", isHere && look === "stopped");
      setClass(made, "wrong", this.problems.some(({ line }) => line !== null && line === row.line));
      if (!isHere) continue;
      this.progress.value = run!.progress;
      made.after(this.progress);
      if (!wasHere) this.scrollTo(item);
    }
    find("program-problems").replaceChildren(
      ...this.problems.map(({ line, text }) => make("li", "problem", line === null ? text : `line ${line}: ${text}`)),
    );
    const state = find("program-state");
    state.className = `program-state ${run && !this.checked ? run.state : ""}`;
    setText(state, this.checked || (run ? this.shortened(this.textOf(run, isShown)) : ""));
  }

  // A text with the names of files instead of their places.
  shortened(text: string): string {
    return this.folder ? text.replaceAll(`${this.folder}/`, "") : text;
  }

  // Scroll the list only: the page stays where the operator looks.
  private scrollTo(item: HTMLElement): void {
    const [list, place] = [this.steps.getBoundingClientRect(), item.getBoundingClientRect()];
    if (place.top < list.top) this.steps.scrollTop -= list.top - place.top;
    if (place.bottom > list.bottom) this.steps.scrollTop += place.bottom - list.bottom;
  }

  private textOf({ state, file, step, steps, executed, text, message, reason }: ProgramRun, isShown: boolean): string {
    if (state === "none") return "not run yet";
    const what = isShown ? "" : `${file} `;
    const told = message ? `\n${message}` : "";
    if (state === "done") return `${what}done, ${executed} steps were executed${told}`;
    const where = step ? `step ${step} of ${steps}, ${text}` : "before its first step";
    return state === "stopped" ? `${what}stopped: ${reason || where}` : `${what}${state}: ${where}${told}`;
  }

  private block(): void {
    const { isActive } = this;
    const state = this.run?.state;
    const canResume = state === "paused" || state === "waiting" || (state === "stopped" && this.run?.name === this.name);
    const isEmpty = !this.program?.rows.length;
    const disabled: Record<string, boolean> = {
      check: isActive || isEmpty,
      run: isActive || isEmpty || this.hindrance !== "",
      step: isActive || isEmpty || this.hindrance !== "",
      pause: state !== "running",
      resume: !canResume,
      stop: !isActive,
    };
    for (const [name, isDisabled] of Object.entries(disabled)) find<HTMLButtonElement>(`program-${name}`).disabled = isDisabled;
    for (const name of ["run", "step"]) find(`program-${name}`).title = this.hindrance;
  }
}

function placeOf({ keys }: ProgramRow): string {
  return keys.join(".");
}

function moved(keys: (string | number)[], edit: "up" | "down"): string {
  return [...keys.slice(0, -1), Number(keys.at(-1)) + (edit === "up" ? -1 : 1)].join(".");
}
