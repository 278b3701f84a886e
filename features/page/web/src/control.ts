// Control side of the page: unlocked by the token, it commands the robot and shows each answer.

import { ControlLink, takeToken } from "./control_link";
import type { Answer, Command, JogEnd, Seen, Welcome } from "./control_messages";
import { find, make, setClass, setText } from "./dom";
import { DrivePanel } from "./drive_panel";
import { FaultForm } from "./fault_form";
import { HeldButtons } from "./held_button";
import { JogPanel } from "./jog_panel";
import type { Description, Sample, State } from "./messages";
import { highlight, hindranceOf } from "./next_step";
import { OutputPanel } from "./output_panel";
import { PreviewPanel } from "./preview_panel";
import { TargetPanel } from "./target_panel";
import { TEACH_NAMES } from "./teach_messages";
import { TeachPanel } from "./teach_panel";
import { ToolJogPanel } from "./tool_jog_panel";
import type { Units } from "./units";
import type { View } from "./view";

// Buttons of a single command, by their id.
const BUTTONS: Record<string, Command> = {
  stop: { type: "stop" },
  reset: { type: "reset" },
  recover: { type: "recover" },
  "servos-on": { type: "servos", on: true },
  "servos-off": { type: "servos", on: false },
  "gripper-open": { type: "gripper", closed: false },
  "gripper-close": { type: "gripper", closed: true },
};

interface Waiting {
  name: string;
  then?: ((answer: Answer) => void) | undefined;
  isQuestion: boolean;
}

export class Control {
  private readonly link = new ControlLink(
    {
      onOpen: (welcome) => this.open(welcome),
      onPanel: (state) => this.teach.show(state),
      onAnswer: (answer) => this.showAnswer(answer),
      onJogEnd: (end) => this.showJogEnd(end),
      onSlow: (reason) => this.toolJog.showSlow(reason),
      onReached: (reached) => this.target.showReached(reached),
      onError: (text) => this.say(text, "bad"),
      onClosed: (reason, isRejected) => this.close(reason, isRejected),
    },
    () => this.seen(),
  );
  private readonly held = new HeldButtons(
    this.link,
    ({ name, step }) => {
      this.isHeldNewest = true;
      this.say(`${name}: ${step === null ? "moving while held" : "on its way"}`, "busy");
    },
    (name, reason) => this.say(`${name}: ${reason}`, "bad"),
  );
  private readonly jog: JogPanel;
  private readonly toolJog: ToolJogPanel;
  private readonly target: TargetPanel;
  private readonly drive: DrivePanel;
  private readonly preview: PreviewPanel;
  private readonly teach: TeachPanel;
  private readonly outputs = new OutputPanel((command) => this.send(command));
  private readonly faults = new FaultForm((command) => this.send(command));
  private readonly answer = find("answer");
  private readonly speed = find<HTMLInputElement>("speed-slider");
  private readonly pause = find<HTMLButtonElement>("pause");
  private readonly waiting = new Map<number, Waiting>(); // commands, by id
  private description: Description | undefined;
  private state: State | undefined;
  private isUnlocked = false;
  private isHeldNewest = false; // no command was sent since a button was held

  constructor(
    units: Units,
    private readonly newest: () => Sample | undefined,
    view: View,
  ) {
    this.jog = new JogPanel(units, this.held);
    this.toolJog = new ToolJogPanel(units, this.held, () => this.target.retarget());
    this.target = new TargetPanel(view, this.link, this.held, this.toolJog);
    this.drive = new DrivePanel(this.held);
    const send = (command: Command, then?: (answer: Answer) => void): void => this.send(command, then);
    const ask = (command: Command, then: (answer: Answer) => void): void => this.ask(command, then);
    this.preview = new PreviewPanel(view, this.held, ask);
    this.teach = new TeachPanel(units, this.held, this.preview, { send, ask, seen: () => this.seen() });
    for (const [id, command] of Object.entries(BUTTONS)) find(id).addEventListener("click", () => this.send(command));
    this.speed.addEventListener("input", () => this.showSpeed(Number(this.speed.value)));
    this.speed.addEventListener("change", () => this.send({ type: "speed", speed: Number(this.speed.value) / 100 }));
    this.pause.addEventListener("click", () =>
      this.send({ type: "pause", paused: this.pause.getAttribute("aria-pressed") !== "true" }),
    );
    document.addEventListener("keydown", (event) => {
      if (event.key === "Escape" && this.isUnlocked) this.send(BUTTONS["stop"]!);
    });
    find<HTMLFormElement>("unlock").addEventListener("submit", (event) => {
      event.preventDefault();
      const field = find<HTMLInputElement>("token");
      this.link.open(field.value.trim().split("token=").at(-1)!);
      field.value = "";
    });
  }

  describe(description: Description): void {
    this.description = description;
    find("control").hidden = !description.has_control;
    const token = takeToken();
    if (description.has_control && token && !this.isUnlocked) this.link.open(token);
  }

  update(state: State): void {
    this.state = state;
    this.outputs.update(state);
    this.pause.setAttribute("aria-pressed", String(state.paused));
    setText(this.pause, state.paused ? "Resume" : "Pause");
    this.jog.update(state);
    this.toolJog.update(state);
    this.target.update(state);
    this.drive.update(state);
    this.preview.update(state);
    this.teach.update(state);
    highlight(hindranceOf(state)?.button);
    if (document.activeElement !== this.speed) {
      this.speed.value = String(Math.round(100 * state.speed));
      this.showSpeed(100 * state.speed);
    }
  }

  show(sample: Sample): void {
    if (!this.isUnlocked) return;
    this.jog.show(sample);
    this.toolJog.showSpeed();
    this.preview.follow(sample);
  }

  private open(welcome: Welcome): void {
    if (!this.description) return;
    this.held.heartbeat_ms = welcome.heartbeat_ms;
    this.jog.open(welcome, this.description);
    this.target.open(welcome);
    this.toolJog.open(welcome);
    this.drive.open(welcome, this.description);
    this.preview.open(this.description);
    this.teach.open(welcome);
    this.outputs.open(welcome);
    this.faults.open(welcome, this.description);
    find("gripper").hidden = !welcome.gripper;
    setText(find("control-name"), `unlocked as ${welcome.name}`);
    this.setUnlocked(true);
    if (this.state) this.update(this.state);
    this.say("Control is unlocked. Watch the robot, not the screen.", "good");
  }

  private close(reason: string, isRejected: boolean): void {
    this.held.end("released");
    this.target.close();
    this.preview.hide();
    this.teach.close();
    this.waiting.clear();
    setText(find("unlock-text"), isRejected ? `Rejected: ${reason}.` : `Not connected: ${reason}.`);
    this.setUnlocked(false);
  }

  private setUnlocked(on: boolean): void {
    this.isUnlocked = on;
    setClass(document.body, "unlocked", on);
    find("bar").hidden = !on;
    find("unlock").hidden = on;
    find("control-name").hidden = !on;
    find("control-body").hidden = !on;
    document.body.dataset["control"] = on ? "yes" : "no";
  }

  private seen(): Seen | null {
    const sample = this.newest();
    return this.state && sample ? { events: this.state.seen, time_s: sample.time_s } : null;
  }

  private send(command: Command, then?: (answer: Answer) => void): void {
    const name = nameOf(command);
    const id = this.link.send(command);
    if (!id) {
      this.say(`${name}: not sent, there is no connection`, "bad");
      return;
    }
    this.waiting.set(id, { name, then, isQuestion: false });
    this.isHeldNewest = false;
    this.say(`${name} …`, "busy");
  }

  // Ask what changes nothing; whoever asks shows the answer.
  private ask(command: Command, then: (answer: Answer) => void): void {
    const id = this.link.send(command);
    if (id) this.waiting.set(id, { name: "", then, isQuestion: true });
  }

  private showAnswer(answer: Answer): void {
    const { id, ok, text } = answer;
    const { name, then, isQuestion } = this.waiting.get(id) ?? { name: "", isQuestion: false };
    this.waiting.delete(id);
    then?.(answer);
    if (isQuestion) return;
    const end = name === TEACH_NAMES["program_run"] ? "" : " rejected"; // a program ends early, after many steps
    this.say(this.teach.shortened(`${name}${ok ? "" : end}: ${text}`), ok ? "good" : "bad");
  }

  private showJogEnd(end: JogEnd): void {
    const { ok, silent, text, what } = end;
    // What a stop of all motion has ended is in the notice and in the answer of the stop. A release
    // says nothing over the answer of a command that was sent meanwhile.
    if (!text.startsWith("stopped: ") && (this.isHeldNewest || !ok)) this.say(ok ? `${what}: ${text}` : `${what} stopped: ${text}${silent ? ": heartbeats of this page came late" : ""}`, ok ? "good" : "bad");
    this.toolJog.showSlow("");
    this.held.ended(end);
  }

  private say(text: string, look: "good" | "bad" | "busy"): void {
    setText(this.answer, text);
    this.answer.className = `answer ${look}`;
    this.answer.scrollTop = this.answer.scrollHeight; // a recovery ends with what was verified
  }

  private showSpeed(percent: number): void {
    find("speed-text").replaceChildren(make("b", "", `${Math.round(percent)} %`));
  }
}

function nameOf(command: Command): string {
  if (command.type in TEACH_NAMES) return TEACH_NAMES[command.type]!;
  switch (command.type) {
    case "servos":
      return command.on ? "Servos on" : "Servos off";
    case "gripper":
      return command.closed ? "Close gripper" : "Open gripper";
    case "speed":
      return "Speed";
    case "pause":
      return command.paused ? "Pause" : "Resume";
    case "output":
      return command.name;
    case "output_bit":
    case "output_byte":
      return "Output";
    case "inject":
      return "Fault";
    default:
      return command.type[0]!.toUpperCase() + command.type.slice(1);
  }
}
