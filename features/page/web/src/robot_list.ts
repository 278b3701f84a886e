// List of the robots that answer, where a page can show several.

import { find, make, setText } from "./dom";
import type { RemoteRobot, Robots } from "./messages";

const PARAMETER = "robot";

export class RobotList {
  private readonly nav = find("robots");
  private readonly hint = find("robots-hint");
  private readonly list = find("robot-names");

  update({ robots, shown }: Robots): void {
    const wanted = new URLSearchParams(location.search).get(PARAMETER);
    const only = robots.length === 1 ? robots[0]!.name : undefined;
    const next = wanted ?? only;
    if (!shown && next !== undefined && robots.some(({ name }) => name === next)) {
      location.replace(address(next)); // it answers now
      return;
    }
    this.nav.hidden = false;
    setText(this.hint, hintOf(robots, wanted));
    this.list.className = shown ? "chips" : "cards";
    document.body.classList.toggle("choosing", !shown);
    const element = shown ? (robot: RemoteRobot) => link(robot, robot.name === shown) : card;
    this.list.replaceChildren(...robots.map((robot) => make("li", "", element(robot))));
    document.body.dataset["robots"] = String(robots.length);
  }
}

function hintOf(robots: RemoteRobot[], wanted: string | null): string {
  if (!robots.length) return "No robot answers yet in this ROS domain.";
  const isGone = wanted !== null && !robots.some(({ name }) => name === wanted);
  if (isGone) return `The robot ${wanted} does not answer. Others do:`;
  return wanted === null ? "Choose a robot:" : "Robots:";
}

function link({ name, robot, backend, computer, simulated }: RemoteRobot, isShown: boolean): HTMLElement {
  const made = make("a", "chip", name === "/" ? robot : `${name.slice(1)} · ${robot}`);
  made.href = address(name);
  made.title = `${backend}${simulated ? ", simulated" : ""}, on ${computer}`;
  if (isShown) made.setAttribute("aria-current", "page");
  return made;
}

// A robot to choose, with its state.
function card(robot: RemoteRobot): HTMLElement {
  const { name, summary, backend, computer, simulated, problems } = robot;
  const [text, look] = problems === null ? ["state not known", "idle"] : problems.length ? [problems.join("; "), "bad"] : ["ready", "good"];
  const made = make(
    "a",
    "panel card",
    make("strong", "", robot.robot),
    make("span", "number", name === "/" ? "no namespace" : `namespace ${name}`),
    make("span", "", summary),
    make("span", "", `${backend}${simulated ? ", simulated" : ""}, on ${computer}`),
    make("span", `lamp ${look}`, text),
  );
  made.href = address(name);
  return made;
}

function address(name: string): string {
  return `?${PARAMETER}=${encodeURIComponent(name)}`;
}
