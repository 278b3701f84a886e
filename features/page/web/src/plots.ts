// Plots of the last minute: freeze, zoom by dragging, hide lines.

import uPlot from "uplot";
import { axisColor, onThemeChange } from "./colors";
import { cssColor, find, make } from "./dom";
import { type History, SECONDS } from "./history";
import type { AxisDescription, Description, Sample } from "./messages";
import type { Units } from "./units";

interface Quantity {
  title: string;
  suffix: string;
  least: number; // half of the smallest range: noise is not magnified to the whole height
  value: (sample: Sample, axis: number) => number;
}

const QUANTITIES: Quantity[] = [
  { title: "Position", suffix: "", least: 0.01, value: (sample, axis) => sample.position(axis) },
  { title: "Velocity", suffix: "/s", least: 0.01, value: (sample, axis) => sample.velocity(axis) },
  { title: "Following error", suffix: "", least: 1e-5, value: (sample, axis) => sample.followingError(axis) },
];
const LATENESS = "Lateness of the control loop";
const LEAST_LATENESS_MS = 0.1;
const SYNC = "plots";

export class Plots {
  private readonly container = find("plot-list");
  private readonly legend = find("plot-legend");
  private readonly freezeButton = find<HTMLButtonElement>("freeze");
  private description: Description | undefined;
  private plots: uPlot[] = [];
  private hidden = new Set<number>();
  private frozen = false;

  constructor(
    private readonly history: History,
    private readonly units: Units,
  ) {
    this.freezeButton.addEventListener("click", () => this.setFrozen(!this.frozen));
    find("zoom-out").addEventListener("click", () => this.zoomOut());
    new ResizeObserver(() => this.resize()).observe(this.container);
    onThemeChange(() => this.build());
  }

  describe(description: Description): void {
    this.description = description;
    this.build();
  }

  build(): void {
    const { description } = this;
    if (!description) return;
    this.plots.forEach((plot) => plot.destroy());
    this.container.replaceChildren();
    const { axes } = description;
    this.plots = [
      ...QUANTITIES.map((quantity) => this.addPlot(quantity.title, this.unitOf(axes, quantity), axes, quantity.least)),
      this.addPlot(LATENESS, "ms", [undefined], LEAST_LATENESS_MS),
    ];
    this.buildLegend(axes);
    this.resize();
    this.redraw(true);
  }

  redraw(always = false): void {
    if ((this.frozen && !always) || !this.description) return;
    const { samples } = this.history;
    const now = samples.at(-1)?.time_s ?? 0;
    const times = samples.map((sample) => sample.time_s - now);
    const { axes } = this.description;
    this.plots.forEach((plot, index) => {
      const quantity = QUANTITIES[index];
      const lines = quantity
        ? axes.map((axis, number) => {
            const factor = this.units.factor(axis.unit);
            return samples.map((sample) => finite(quantity.value(sample, number) * factor));
          })
        : [samples.map((sample) => finite(sample.late_s * 1000))];
      plot.setData([times, ...lines], false);
      plot.setScale("x", { min: -SECONDS, max: 0 });
    });
  }

  private addPlot(title: string, unit: string, axes: (AxisDescription | undefined)[], least: number): uPlot {
    const figure = make("figure", "", make("figcaption", "", title, make("small", "", unit)));
    this.container.append(figure);
    const line = cssColor("--line");
    const text = cssColor("--muted");
    const scale = { stroke: text, grid: { stroke: line, width: 1 }, ticks: { show: false }, font: "11px system-ui" };
    const options: uPlot.Options = {
      width: 300,
      height: 160,
      legend: { show: false },
      cursor: { drag: { x: true, y: false }, sync: { key: SYNC, setSeries: false }, points: { size: 5 } },
      scales: { x: { time: false }, y: { range: (_, low, high) => roomyRange(low, high, least) } },
      axes: [
        { ...scale, size: 28, values: (_, ticks) => ticks.map((tick) => `${tick} s`) },
        { ...scale, size: 58, space: 26, values: tickTexts },
      ],
      series: [
        {},
        ...axes.map((axis, number) => ({
          label: axis?.name ?? title,
          stroke: axisColor(number),
          width: 1.5,
          show: !axis || !this.hidden.has(number),
          points: { show: false },
        })),
      ],
      hooks: {
        setSelect: [() => this.setFrozen(true)],
        setScale: [
          ({ scales: { x } }, key) => {
            if (key === "x") figure.dataset["seconds"] = `${x!.min} ${x!.max}`; // for tests
          },
        ],
      },
    };
    const plot = new uPlot(options, [[], ...axes.map(() => [])], figure);
    plot.over.addEventListener("dblclick", () => this.zoomOut());
    return plot;
  }

  private buildLegend(axes: AxisDescription[]): void {
    this.legend.replaceChildren(
      ...axes.map((axis, number) => {
        const color = make("i", "swatch");
        color.style.background = axisColor(number);
        const button = make("button", "chip", color, axis.name);
        button.type = "button";
        button.setAttribute("aria-pressed", String(!this.hidden.has(number)));
        button.addEventListener("click", () => {
          const show = this.hidden.has(number);
          if (show) this.hidden.delete(number);
          else this.hidden.add(number);
          button.setAttribute("aria-pressed", String(show));
          this.plots.slice(0, QUANTITIES.length).forEach((plot) => plot.setSeries(number + 1, { show }));
        });
        return button;
      }),
    );
  }

  private unitOf(axes: AxisDescription[], { suffix }: Quantity): string {
    const units = new Set(axes.map((axis) => `${this.units.name(axis.unit)}${suffix}`));
    return [...units].join(", ");
  }

  private setFrozen(frozen: boolean): void {
    this.frozen = frozen;
    this.freezeButton.setAttribute("aria-pressed", String(frozen));
    this.freezeButton.textContent = frozen ? "Continue" : "Freeze";
  }

  private zoomOut(): void {
    this.setFrozen(false);
    this.redraw();
  }

  private resize(): void {
    for (const plot of this.plots) {
      const width = plot.root.parentElement!.clientWidth;
      if (width) plot.setSize({ width, height: 160 });
    }
  }
}

// As many decimals as the distance of the ticks needs.
function tickTexts(_: uPlot, ticks: number[], __: number, ___: number, distance: number): string[] {
  const decimals = Math.min(Math.max(-Math.floor(Math.log10(distance) + 1e-9), 0), 6);
  return ticks.map((tick) => tick.toFixed(decimals).replace("-", "−"));
}

function finite(value: number): number | null {
  return Number.isFinite(value) ? value : null;
}

// Range with room around the lines, of at least twice ``least``.
function roomyRange(low: number | null, high: number | null, least: number): [number, number] {
  const [from, to] = [low ?? 0, high ?? 0];
  const room = Math.max((to - from) * 0.08, least - (to - from) / 2);
  return [from - room, to + room];
}
