// Form that injects a fault into the simulation; its fields are those of the chosen kind.

import type { Command, FaultField, Welcome } from "./control_messages";
import { find, make } from "./dom";
import type { Description } from "./messages";

// First values of fields that have no default.
const EXAMPLES: Record<string, number> = { axis: 0, count: 5, late_s: 0.02, byte: 0, bit: 0, delta_rad: 0.1 };

export class FaultForm {
  private readonly kind = find<HTMLSelectElement>("fault-kind");
  private readonly fields = find("fault-fields");
  private faults: Record<string, FaultField[]> = {};
  private axes: string[] = [];
  private inputs: { field: FaultField; input: HTMLInputElement | HTMLSelectElement }[] = [];

  constructor(send: (command: Command) => void) {
    this.kind.addEventListener("change", () => this.build());
    find<HTMLFormElement>("fault-form").addEventListener("submit", (event) => {
      event.preventDefault();
      send({ type: "inject", fault: { [this.kind.value]: this.values() } });
    });
  }

  open({ faults }: Welcome, { axes }: Description): void {
    this.faults = faults;
    this.axes = axes.map((axis) => axis.name);
    find("faults-box").hidden = !Object.keys(faults).length;
    this.kind.replaceChildren(
      ...Object.keys(faults).map((kind) => {
        const option = make("option", "", kind.replaceAll("_", " "));
        option.value = kind;
        return option;
      }),
    );
    this.build();
  }

  private build(): void {
    this.inputs = (this.faults[this.kind.value] ?? []).map((field) => ({ field, input: this.input(field) }));
    this.fields.replaceChildren(
      ...this.inputs.map(({ field, input }) => make("label", "field", make("span", "", field.name), input)),
    );
  }

  private input(field: FaultField): HTMLInputElement | HTMLSelectElement {
    if (field.name === "axis" || field.type === "boolean") {
      const select = make("select");
      const names = field.name === "axis" ? this.axes : ["off", "on"];
      select.append(
        ...names.map((name, value) => {
          const option = make("option", "", name);
          option.value = String(value);
          return option;
        }),
      );
      if (field.type === "boolean") select.value = "1";
      return select;
    }
    const input = make("input");
    input.type = "number";
    input.step = "any";
    input.required = !field.optional;
    input.value = String(field.default ?? EXAMPLES[field.name] ?? "");
    if (field.optional && field.default === null) input.placeholder = "until removed";
    return input;
  }

  private values(): Record<string, number | boolean> {
    const given = this.inputs.filter(({ input }) => input.value !== "");
    return Object.fromEntries(
      given.map(({ field, input }) => [field.name, field.type === "boolean" ? input.value === "1" : Number(input.value)]),
    );
  }
}
