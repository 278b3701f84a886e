// Banners: faults with their remedies, simulation, lost connection.

import { find, make, setText } from "./dom";
import type { Description, Problem, State } from "./messages";
import { withButtons } from "./next_step";

export class Banners {
  private readonly faults = find("faults");
  private readonly notices = find("notices");
  private readonly lost = find("lost");
  private readonly simulated = find("simulated");
  private name = "robotd";
  private shown = "";

  describe(description: Description): void {
    this.name = titleOf(description);
    this.lost.hidden = true;
    this.simulated.hidden = !description.simulated;
  }

  update({ problems }: State): void {
    const shown = JSON.stringify(problems);
    if (shown === this.shown) return;
    this.shown = shown;
    const faults = problems.filter((each) => each.is_fault);
    const notices = problems.filter((each) => !each.is_fault);
    this.faults.hidden = !faults.length;
    this.faults.replaceChildren(...faults.map((each, index) => block(each, index === 0)));
    this.notices.hidden = !notices.length;
    this.notices.replaceChildren(...notices.map((each) => block(each, false)));
    const root = faults[0];
    document.title = root ? `FAULT ${root.text} – ${this.name}` : this.name;
  }

  showLost(reason: string): void {
    setText(this.lost, `${reason}. What is shown is old. Trying again …`);
    this.lost.hidden = false;
    document.title = `connection lost – ${this.name}`;
    this.shown = "";
  }

  showOtherVersion(): void {
    setText(this.lost, "robotd has another version than this page: load the page again.");
    this.lost.hidden = false;
  }
}

// Name of the robot in the title of the tab: enough to tell it from others beside it.
function titleOf({ robot, namespace, backend, computer, simulated }: Description): string {
  const name = namespace === "/" ? robot : `${namespace.slice(1)} · ${robot}`;
  return `${name} – ${backend} on ${computer}${simulated ? " – SIMULATED" : ""}`;
}

function block(problem: Problem, isRoot: boolean): HTMLElement {
  const text = make("p", isRoot ? "root" : "", problem.text);
  if (!problem.remedy) return make("div", "", text);
  const [command, press] = [make("p", "remedy command", problem.remedy), make("p", "remedy press", withButtons(problem.remedy))];
  return make("div", "", text, command, press); // the style sheet shows one of them
}
