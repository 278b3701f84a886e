// Line colours of axes: distinct for people who confuse colours (Okabe and Ito), darkened for contrast.

const LIGHT = ["#0067a5", "#c05200", "#00795a", "#a0357a", "#8a6d00", "#4f5bd5", "#2a8fb8", "#6b6b6b"];
const DARK = ["#56b4e9", "#ff9d4d", "#3fcf9f", "#e58cc4", "#e3cc4a", "#a3abff", "#7fd6f2", "#b5b5b5"];

const darkQuery = matchMedia("(prefers-color-scheme: dark)");

export function axisColor(axis: number): string {
  const colors = darkQuery.matches ? DARK : LIGHT;
  return colors[axis % colors.length]!;
}

export function onThemeChange(listener: () => void): void {
  darkQuery.addEventListener("change", listener);
}
