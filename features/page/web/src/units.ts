// Units of the shown values: SI, or degrees for what turns.

const KEY = "robotd-degrees";
const DEGREES = 180 / Math.PI;

export class Units {
  degrees = localStorage.getItem(KEY) === "1";

  toggle(): void {
    this.degrees = !this.degrees;
    localStorage.setItem(KEY, this.degrees ? "1" : "0");
  }

  factor(unit: string): number {
    return this.degrees && unit === "rad" ? DEGREES : 1;
  }

  name(unit: string): string {
    return this.degrees && unit === "rad" ? "°" : unit;
  }

  digits(unit: string): number {
    return this.degrees && unit === "rad" ? 2 : 4;
  }
}

export function signed(value: number, digits: number): string {
  if (!Number.isFinite(value)) return "–";
  const text = value.toFixed(digits);
  return value < 0 && Number(text) !== 0 ? text.replace("-", "−") : `+${text.replace("-", "")}`;
}
