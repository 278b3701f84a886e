// Names of joints: each can be read as a whole, and what distinguishes it from others stands out.

import { make } from "./dom";

const SEPARATORS = /(?<=[_\-./ ])/; // a name breaks after these, and a shared start ends there

// Return the element of each name. It breaks into lines where it is too long for its place.
export function nameElements(names: string[]): HTMLElement[] {
  return names.map((name) => {
    const own = name.slice(sharedLength(name, names));
    const shared = name.slice(0, name.length - own.length);
    return make("span", "joint-name", ...broken(shared, "span"), ...broken(own, "b"));
  });
}

// Length of the longest beginning, up to a separator, that another name has too.
function sharedLength(name: string, names: string[]): number {
  const others = names.filter((other) => other !== name);
  let length = 0;
  for (const part of name.split(SEPARATORS).slice(0, -1)) {
    if (!others.some((other) => other.startsWith(name.slice(0, length + part.length)))) break;
    length += part.length;
  }
  return length;
}

function broken(text: string, tag: "span" | "b"): HTMLElement[] {
  if (!text) return [];
  const parts = text.split(SEPARATORS).flatMap((part) => [make("wbr"), part]);
  return [make(tag, "", ...parts)];
}
