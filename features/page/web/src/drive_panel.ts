// Panel that drives the base: a button for each direction, and the speed.

import type { Drive, Welcome } from "./control_messages";
import { find, make, setText } from "./dom";
import type { HeldButtons } from "./held_button";
import type { Description, State } from "./messages";
import { hindranceOfAxes, labelOf } from "./next_step";

export class DrivePanel {
  private readonly slider = find<HTMLInputElement>("drive-speed");
  private drive: Drive | undefined;
  private wheels: number[] = []; // axes
  private buttons: HTMLButtonElement[] = [];

  constructor(private readonly held: HeldButtons) {
    this.slider.addEventListener("input", () => this.showSpeed());
  }

  open({ drive }: Welcome, { axes }: Description): void {
    find("drive").hidden = !drive;
    if (!drive) return;
    this.drive = drive;
    this.wheels = axes.flatMap(({ kind }, axis) => (kind === "wheel" ? [axis] : []));
    this.buttons = drive.motions.map(({ name, linear, lateral, angular }) => {
      const button = make("button", "action", name);
      button.type = "button";
      this.held.add(button, () => {
        const share = this.share();
        return {
          name,
          step: null,
          send: (link, hold) => link.drive(hold, share * linear, share * lateral, share * angular),
        };
      });
      return button;
    });
    find("drive-buttons").replaceChildren(...this.buttons);
    const { release_s, rest_s, rest_m, linear } = drive;
    setText(
      find("drive-hint"),
      `The base moves while its button is held. Letting go, or losing this page, lets it slow down within ` +
        `${Math.round(1000 * release_s)} ms, as its own limits allow: from ${linear.toFixed(2)} m/s it rests after ` +
        `${rest_s.toFixed(1)} s and ${(100 * rest_m).toFixed(0)} cm.`,
    );
    this.showSpeed();
  }

  // Disable what cannot move now, and say why.
  update(state: State): void {
    if (!this.drive) return;
    const hindrance = hindranceOfAxes(state, this.wheels);
    const next = hindrance?.button ? ` Next: ${labelOf(hindrance.button)}.` : "";
    for (const button of this.buttons) this.held.block(button, hindrance?.reason ?? "");
    find("drive-blocked").hidden = !hindrance;
    setText(find("drive-blocked"), hindrance ? `The base cannot be driven: ${hindrance.reason}.${next}` : "");
  }

  private share(): number {
    return Number(this.slider.value) / 100;
  }

  private showSpeed(): void {
    if (!this.drive) return;
    const { linear, angular } = this.drive;
    setText(find("drive-speed-text"), `${(this.share() * linear).toFixed(3)} m/s, ${(this.share() * angular).toFixed(2)} rad/s`);
  }
}
