// Hold to run: a joint or the base moves while its button is held, by pointer or key, in a focused window.

import type { ControlLink } from "./control_link";
import type { JogEnd, ReleaseReason } from "./control_messages";

export interface Motion {
  name: string; // of the joint, or of the direction of the base
  step: number | null; // signed distance, or what is left of a move; null: as long as the button is held
  send: (link: ControlLink, hold: number, step: number | null) => void; // one heartbeat
}

const STALL_MS = 500; // a page that has not run for so long ends its hold

interface Held {
  hold: number;
  button: HTMLButtonElement;
  motion: Motion; // a step goes on after the button is released
  timer: ReturnType<typeof setInterval>;
  beat_ms: number; // time of the last heartbeat
}

// One button is held at a time. The server stops the motion as well, when heartbeats are missing.
export class HeldButtons {
  private lastHold = 0;
  private held: Held | undefined;

  constructor(
    private readonly link: ControlLink,
    private readonly onStart: (motion: Motion) => void,
    private readonly onBlocked: (name: string, reason: string) => void,
  ) {
    addEventListener("blur", () => this.end("window lost focus"));
    addEventListener("pagehide", () => this.end("page left"));
    document.addEventListener("visibilitychange", () => {
      if (document.hidden) this.end("tab hidden");
    });
  }

  heartbeat_ms = 20;

  add(button: HTMLButtonElement, motion: () => Motion): void {
    const begin = (): void => this.begin(button, motion());
    const end = (): void => this.releaseButton(button);
    button.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      button.setPointerCapture(event.pointerId);
      begin();
    });
    for (const name of ["pointerup", "pointercancel", "lostpointercapture", "blur"]) button.addEventListener(name, end);
    button.addEventListener("keydown", (event) => {
      if (event.key !== " " && event.key !== "Enter") return;
      event.preventDefault();
      if (!event.repeat) begin();
    });
    button.addEventListener("keyup", (event) => {
      if (event.key === " " || event.key === "Enter") end();
    });
    button.addEventListener("contextmenu", (event) => event.preventDefault());
  }

  // The server has ended a hold. Where heartbeats came late, and the button is still held or a step is not
  // finished, a new hold begins: its number proves that this page is alive after the end of the one before.
  ended({ hold, silent, remaining }: JogEnd): void {
    if (this.held?.hold !== hold) return;
    const { button, motion, beat_ms } = this.held;
    this.clear();
    const isAlive = performance.now() - beat_ms < STALL_MS;
    if (silent && isAlive) this.begin(button, { ...motion, step: remaining });
  }

  end(reason: ReleaseReason): void {
    if (!this.held) return;
    this.link.release(this.held.hold, reason);
    this.clear();
  }

  // Disable a button, with the reason; "" enables it. It can be pressed on, to read the reason.
  block(button: HTMLButtonElement, reason: string): void {
    if (button.title === reason) return;
    button.title = reason;
    button.setAttribute("aria-disabled", String(reason !== ""));
  }

  private begin(button: HTMLButtonElement, motion: Motion): void {
    this.end("released");
    if (button.title) {
      this.onBlocked(motion.name, button.title);
      return;
    }
    this.lastHold += 1;
    const hold = this.lastHold;
    this.held = {
      hold,
      button,
      motion,
      timer: setInterval(() => this.beat(), this.heartbeat_ms),
      beat_ms: performance.now(),
    };
    button.classList.add("held");
    this.onStart(motion);
    this.beat();
  }

  private beat(): void {
    if (!this.held) return;
    const { hold, motion, beat_ms } = this.held;
    this.held.beat_ms = performance.now();
    if (this.held.beat_ms - beat_ms > STALL_MS) this.end("page stalled");
    else motion.send(this.link, hold, motion.step);
  }

  private releaseButton(button: HTMLButtonElement): void {
    if (this.held?.button === button && this.held.motion.step === null) this.end("released");
  }

  private clear(): void {
    if (!this.held) return;
    clearInterval(this.held.timer);
    this.held.button.classList.remove("held");
    this.held = undefined;
  }
}
