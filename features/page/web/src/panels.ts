// Panels besides the joints: goal, I/O, fieldbus, nodes, events, and the chips of the head.

import { find, make, setClass, setText } from "./dom";
import type { Bus, BusNode, Description, Goal, RobotEvent, Sample, State } from "./messages";

const MAX_EVENTS = 500;
const FIRST_BYTES = 4;
const WORDS: Record<string, string> = { in: "Inputs", out: "Outputs" };

export class HeadPanel {
  describe(description: Description): void {
    setText(find("robot"), description.robot);
    setText(find("namespace"), description.namespace);
    find("namespace").hidden = description.namespace === "/";
    setText(find("computer"), `on ${description.computer}`);
    find("simulated-chip").hidden = !description.simulated;
    setText(find("summary"), description.summary);
    const variant = description.variant ? ` · ${description.variant}` : "";
    const scale = description.time_scale === null ? "∞" : String(description.time_scale);
    const pace = description.time_scale === 1 ? "" : ` · time × ${scale}`;
    setText(find("backend"), `${description.backend}${variant} · ${description.rate_hz} Hz${pace}`);
    setText(find("version"), `robotd ${description.version}`);
    find("nodes").replaceChildren(...description.nodes.map((name) => make("li", "", name)));
  }

  update(state: State): void {
    const ready = find("ready");
    const [text, look] = readiness(state);
    setText(ready, text);
    ready.className = `chip ${look}`;
    setText(find("speed"), state.paused ? "paused" : `speed ${Math.round(100 * state.speed)} %`);
    setClass(find("speed"), "warn", state.paused || state.speed < 1);
    setText(find("viewers"), `${state.viewers} viewer${state.viewers === 1 ? "" : "s"}`);
    setText(find("missed"), `${state.missed} missed deadlines`);
  }
}

export class GoalPanel {
  private rows: { element: HTMLElement; text: HTMLElement; bar: HTMLProgressElement; duration_s: number }[] = [];
  private readonly none = make("p", "hint", "No goal is running.");

  describe({ groups, axes }: Description): void {
    this.rows = groups.map((name) => {
      const title = groups.length > 1 ? name : "Goal";
      const [text, bar] = [make("p"), make("progress")];
      bar.setAttribute("aria-label", `Progress of the goal ${groups.length > 1 ? name : ""}`);
      return { element: make("div", "goal-row", make("h2", "", title), text, bar), text, bar, duration_s: 0 };
    });
    find("goals").hidden = !axes.some((axis) => axis.kind === "joint");
    find("goals").replaceChildren(...this.rows.map(({ element }) => element), this.none);
  }

  update({ goals }: State): void {
    this.rows.forEach((row, group) => {
      const goal = goals[group];
      row.duration_s = goal?.duration_s ?? 0;
      row.bar.hidden = !goal;
      row.element.hidden = !goal && this.rows.length > 1;
      setText(row.text, goal ? goalText(goal) : "no goal is running");
    });
    this.none.hidden = this.rows.length === 1 || goals.some(Boolean);
  }

  show(sample: Sample): void {
    this.rows.forEach(({ bar, duration_s }, group) => {
      const time_s = sample.goal_s(group);
      if (duration_s && Number.isFinite(time_s)) bar.value = Math.min(Math.max(time_s / duration_s, 0), 1);
    });
  }
}

export class IoPanel {
  private bits = new Map<string, HTMLElement[]>(); // by address: named and numbered

  describe({ inputs, outputs, io_names }: Description): void {
    this.bits.clear();
    const named = Object.entries(io_names).map(([address, name]) => {
      const lamp = this.lamp(address);
      return make("li", "named", lamp, make("span", "", name), make("small", "", label(address)));
    });
    find("io-named").replaceChildren(...named);
    find("io-bytes").replaceChildren(this.bytes("in", inputs), this.bytes("out", outputs));
    find("io").hidden = !inputs && !outputs;
  }

  update({ inputs, outputs }: State): void {
    this.show("in", inputs);
    this.show("out", outputs);
  }

  private show(direction: string, image: string): void {
    for (const [address, lamps] of this.bits) {
      if (!address.startsWith(direction)) continue;
      const [byte, bit] = address.slice(direction.length).split(".").map(Number) as [number, number];
      const digits = image.slice(2 * byte, 2 * byte + 2);
      const on = digits !== "" && ((parseInt(digits, 16) >> bit) & 1) === 1;
      for (const lamp of lamps) {
        setClass(lamp, "on", on);
        lamp.setAttribute("aria-label", `${label(address)} ${digits ? (on ? "on" : "off") : "not known"}`);
      }
    }
  }

  private bytes(direction: "in" | "out", count: number): HTMLElement {
    const rows = Array.from({ length: count }, (_, byte) => {
      const lamps = Array.from({ length: 8 }, (_, bit) => this.lamp(`${direction}${byte}.${7 - bit}`));
      return make("div", "byte", make("small", "", String(byte)), ...lamps);
    });
    const made = make("div", "bytes", make("h3", "", WORDS[direction]!), ...rows.slice(0, FIRST_BYTES));
    if (rows.length > FIRST_BYTES) {
      const rest = make("summary", "", `bytes ${FIRST_BYTES} to ${rows.length - 1}`);
      made.append(make("details", "", rest, ...rows.slice(FIRST_BYTES)));
    }
    return made;
  }

  private lamp(address: string): HTMLElement {
    const made = make("i", "bit");
    made.setAttribute("role", "img");
    made.title = label(address);
    this.bits.set(address, [...(this.bits.get(address) ?? []), made]);
    return made;
  }
}

export class BusPanel {
  private shown = "";

  update({ buses }: State): void {
    const shown = JSON.stringify(buses);
    if (shown === this.shown) return;
    this.shown = shown;
    find("bus").hidden = !buses.length;
    find("buses").replaceChildren(...buses.map(busElement));
  }
}

export class EventPanel {
  private readonly list = find<HTMLTableSectionElement>("events");
  private offset_s = 0;

  constructor() {
    for (const button of document.querySelectorAll<HTMLButtonElement>("[data-filter]")) {
      button.addEventListener("click", () => this.filter(button));
    }
  }

  describe(description: Description): void {
    this.offset_s = description.wall_offset_s;
    this.list.replaceChildren();
  }

  add(events: RobotEvent[]): void {
    for (const event of events) {
      const key = `${event.kind} ${event.sender} ${event.text}`;
      const last = this.list.rows[0];
      if (last && last.dataset["key"] === key) {
        // A stream of equal commands takes one line.
        const count = Number(last.dataset["count"] ?? 1) + 1;
        last.dataset["count"] = String(count);
        setText(last.cells[0]!, this.timeOf(event));
        setText(last.cells[3]!, `× ${count}`);
      } else {
        this.list.prepend(this.row(event, key));
      }
    }
    while (this.list.rows.length > MAX_EVENTS) this.list.deleteRow(-1);
  }

  private timeOf(event: RobotEvent): string {
    const date = new Date((event.time_s + this.offset_s) * 1000);
    return `${date.toLocaleTimeString([], { hour12: false })}.${String(date.getMilliseconds()).padStart(3, "0")}`;
  }

  private row(event: RobotEvent, key: string): HTMLElement {
    const sender = event.sender && event.sender !== "robotd" ? ` [${event.sender}]` : "";
    const made = make(
      "tr",
      `${event.level} ${event.kind}`,
      make("td", "time", this.timeOf(event)),
      make("td", "kind", event.kind),
      make("td", "", `${event.text}${sender}`),
      make("td", "count"),
    );
    made.dataset["key"] = key;
    return made;
  }

  private filter(button: HTMLButtonElement): void {
    for (const each of document.querySelectorAll("[data-filter]")) {
      each.setAttribute("aria-pressed", String(each === button));
    }
    this.list.dataset["show"] = button.dataset["filter"]!;
  }
}

function readiness({ ready, device, problems }: State): [string, string] {
  if (problems.some((each) => each.is_fault)) return ["fault", "bad"];
  if (!ready) return [`${device}, not ready`, "warn"];
  const kinds = new Set(problems.map((each) => each.kind));
  const outside = kinds.delete("outside limits");
  kinds.delete("source");
  kinds.delete("reduced speed");
  kinds.delete("paused");
  if (kinds.size) return ["not ready for motion", "warn"];
  return outside ? ["ready, a joint is outside its limits", "warn"] : ["ready", "good"];
}

function goalText({ joints, duration_s, sender, ending }: Goal): string {
  const client = sender ? ` from ${sender}` : "";
  const stopping = ending ? `; stopping: ${ending}` : "";
  return `goal of ${joints.length} joints over ${duration_s.toFixed(1)} s${client}${stopping}`;
}

function label(address: string): string {
  return address.replace(/^in/, "input ").replace(/^out/, "output ");
}

function busElement(bus: Bus): HTMLElement {
  const counters = [
    ["lost frames", bus.lost_frames],
    ["time-outs", bus.timeouts],
    ["late cycles", bus.late_cycles],
    ...Object.entries(bus.details),
  ].map(([name, value]) => make("div", "", make("dt", "", String(name)), make("dd", "", String(value))));
  const head = make("h3", "", bus.name, " ", make("span", `lamp ${bus.state === "operational" ? "good" : "idle"}`, bus.state));
  const note = bus.note ? [make("p", "note", bus.note)] : [];
  return make("div", "busbox", head, make("dl", "counters", ...counters), ...note, make("ol", "chain", ...bus.nodes.map(nodeElement)));
}

function nodeElement(node: BusNode): HTMLElement {
  const bad = node.offline || node.error_code !== 0 || node.fault !== "";
  const kind = node.axes ? `${node.axes} ax${node.axes === 1 ? "is" : "es"}` : "I/O";
  const error = node.error_code ? ` · error 0x${node.error_code.toString(16)}` : "";
  const state = make("span", `lamp ${bad ? "bad" : node.state === "operational" ? "good" : "idle"}`, node.state);
  return make(
    "li",
    bad ? "faulty" : "",
    make("b", "", `node ${node.id}`),
    state,
    make("small", "", `${kind}${error}${node.fault ? ` · ${node.fault}` : ""}`),
  );
}
