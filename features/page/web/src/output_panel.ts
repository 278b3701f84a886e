// Switches of outputs: those with a name, and any bit or byte.

import type { Command, Welcome } from "./control_messages";
import { find, make } from "./dom";
import type { State } from "./messages";

export class OutputPanel {
  private readonly byte = find<HTMLInputElement>("output-byte");
  private readonly bit = find<HTMLInputElement>("output-bit");
  private readonly value = find<HTMLInputElement>("output-value");
  private switches: { button: HTMLButtonElement; address: string }[] = [];

  constructor(private readonly send: (command: Command) => void) {
    for (const value of [true, false]) {
      find(value ? "output-on" : "output-off").addEventListener("click", () =>
        send({ type: "output_bit", byte: Number(this.byte.value), bit: Number(this.bit.value), value }),
      );
    }
    find("output-set").addEventListener("click", () =>
      send({ type: "output_byte", byte: Number(this.byte.value), value: Number(this.value.value) }),
    );
  }

  open({ outputs, output_bytes }: Welcome): void {
    find("outputs").hidden = !output_bytes;
    this.byte.max = String(output_bytes - 1);
    this.switches = Object.entries(outputs).map(([name, address]) => {
      const button = make("button", "switch", make("span", "", name), make("small", "", address.slice(3)));
      button.type = "button";
      button.setAttribute("role", "switch");
      button.addEventListener("click", () =>
        this.send({ type: "output", name, value: button.getAttribute("aria-checked") !== "true" }),
      );
      return { button, address };
    });
    find("output-names").replaceChildren(...this.switches.map(({ button }) => button));
  }

  update({ outputs }: State): void {
    for (const { button, address } of this.switches) {
      const [byte, bit] = address.slice(3).split(".").map(Number) as [number, number];
      const digits = outputs.slice(2 * byte, 2 * byte + 2);
      button.setAttribute("aria-checked", String(digits !== "" && ((parseInt(digits, 16) >> bit) & 1) === 1));
    }
  }
}
