// The page: receives messages, and shows each part at its own pace.

import { AxesTable } from "./axes";
import { Banners } from "./banners";
import { CameraPanel } from "./cameras";
import { connect } from "./connection";
import { Control } from "./control";
import { find, setClass } from "./dom";
import { History } from "./history";
import { type Description, type Message, PROTOCOL, samplesOf } from "./messages";
import { BusPanel, EventPanel, GoalPanel, HeadPanel, IoPanel } from "./panels";
import { Plots } from "./plots";
import { ToolPanel } from "./tools";
import { Units } from "./units";
import { View } from "./view";

const NUMBERS_MS = 100; // numbers that change faster cannot be read
const PLOTS_MS = 200;

const units = new Units();
const history = new History();
const view = new View();
const axes = new AxesTable(units);
const plots = new Plots(history, units);
const banners = new Banners();
const head = new HeadPanel();
const goals = new GoalPanel();
const io = new IoPanel();
const bus = new BusPanel();
const events = new EventPanel();
const cameras = new CameraPanel();
const tools = new ToolPanel(view, units);
const control = new Control(units, () => history.newest, view);
let description: Description | undefined;
let numbersDue = 0;
let plotsDue = 0;

function describe(message: Description): void {
  if (message.protocol !== PROTOCOL) {
    banners.showOtherVersion();
    return;
  }
  description = message;
  history.clear();
  for (const part of [view, cameras, axes, tools, plots, banners, head, goals, io, events, control]) part.describe(message);
  setClass(document.body, "lost", false);
  document.body.dataset["connected"] = "yes";
}

function receive(message: Message): void {
  switch (message.type) {
    case "description":
      describe(message);
      break;
    case "state":
      for (const part of [banners, head, goals, io, bus, control]) part.update(message);
      axes.update(message.axes);
      view.setFaults(message.axes.map((each) => Boolean(each.fault)));
      break;
    case "events":
      events.add(message.events);
      break;
    case "objects":
      view.moveObjects(message.poses);
      break;
    case "scene":
      view.showSolids(message.solids);
      break;
  }
}

function showLost(reason: string): void {
  cameras.stop();
  banners.showLost(reason);
  setClass(document.body, "lost", true);
  document.body.dataset["connected"] = "no";
}

function draw(now: number): void {
  const sample = history.newest;
  if (sample && now >= numbersDue) {
    numbersDue = now + NUMBERS_MS;
    axes.show(sample);
    tools.show(sample);
    goals.show(sample);
    control.show(sample);
  }
  if (now >= plotsDue) {
    plotsDue = now + PLOTS_MS;
    plots.redraw();
  }
  view.draw();
  requestAnimationFrame(draw);
}

const degrees = find<HTMLButtonElement>("degrees");
degrees.setAttribute("aria-pressed", String(units.degrees));
degrees.addEventListener("click", () => {
  units.toggle();
  degrees.setAttribute("aria-pressed", String(units.degrees));
  plots.build();
});

connect({
  onMessage: receive,
  onSamples(data) {
    if (!description) return;
    const { axes, groups } = description;
    for (const sample of samplesOf(data, axes.length, groups.length)) history.add(sample);
    if (history.newest) view.show(history.newest);
  },
  onLost(reason) {
    description = undefined;
    showLost(reason);
  },
});
requestAnimationFrame(draw);
