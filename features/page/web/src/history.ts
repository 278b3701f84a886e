// Samples of the last minute.

import type { Sample } from "./messages";

export const SECONDS = 60;

export class History {
  samples: Sample[] = [];

  clear(): void {
    this.samples = [];
  }

  add(sample: Sample): void {
    const last = this.samples.at(-1);
    if (last && sample.time_s <= last.time_s) return;
    this.samples.push(sample);
    const oldest = sample.time_s - SECONDS;
    // In blocks: removing one sample at a time would move the array each time.
    const first = this.samples[64];
    if (first && first.time_s < oldest) this.samples.splice(0, 64);
  }

  get newest(): Sample | undefined {
    return this.samples.at(-1);
  }
}
