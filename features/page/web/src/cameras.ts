// Pictures of the cameras of a simulated world, while they can be seen.

import { find, make } from "./dom";
import type { Description, WorldCamera } from "./messages";

const RETRY_MS = 5000; // after a picture that could not be made

export class CameraPanel {
  private readonly panel = find("cameras");
  private readonly list = find("camera-list");
  private pictures: CameraPicture[] = [];
  private isSeen = false;

  constructor() {
    new IntersectionObserver((entries) => this.look(entries.some((each) => each.isIntersecting))).observe(this.panel);
    document.addEventListener("visibilitychange", () => this.look(this.isSeen));
  }

  describe({ cameras = [] }: Description): void {
    this.stop();
    this.pictures = cameras.map((each) => new CameraPicture(each));
    this.list.replaceChildren(...this.pictures.map(({ element }) => element));
    this.panel.hidden = !cameras.length;
    this.look(this.isSeen);
  }

  stop(): void {
    for (const picture of this.pictures) picture.run(false);
  }

  private look(isSeen: boolean): void {
    this.isSeen = isSeen;
    for (const picture of this.pictures) picture.run(isSeen && !document.hidden);
  }
}

// Asks for the next picture when the last one is shown: a slow connection has fewer, not older ones.
class CameraPicture {
  readonly element: HTMLElement;
  private readonly note = make("span", "hint");
  private image: HTMLImageElement;
  private runs = false;
  private number = 0;
  private timer = 0;

  constructor(private readonly camera: WorldCamera) {
    this.image = this.emptyImage();
    this.element = make("figure", "", this.image, make("figcaption", "", `${camera.name} `, this.note));
  }

  run(on: boolean): void {
    if (on === this.runs) return;
    this.runs = on;
    clearTimeout(this.timer);
    if (on) this.ask();
  }

  private ask(): void {
    const asked = performance.now();
    const image = this.emptyImage(); // the shown one stays until this one is complete
    image.addEventListener("load", () => {
      this.image.replaceWith(image);
      this.image = image;
      this.note.textContent = "";
      this.wait(1000 / this.camera.rate_hz - (performance.now() - asked));
    });
    image.addEventListener("error", () => {
      this.note.textContent = "no picture: see the log of robotd";
      this.wait(RETRY_MS);
    });
    image.src = `/camera/${encodeURIComponent(this.camera.name)}?n=${this.number++}`;
  }

  private wait(ms: number): void {
    clearTimeout(this.timer);
    if (this.runs) this.timer = setTimeout(() => this.ask(), Math.max(0, ms));
  }

  private emptyImage(): HTMLImageElement {
    const { name, width, height } = this.camera;
    const image = make("img");
    image.alt = `Picture of ${name}`;
    [image.width, image.height] = [width, height];
    return image;
  }
}
