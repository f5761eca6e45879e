/** Colours by their names in the style sheet. */

export function coloursOf<Name extends string>(
  element: Element,
  names: readonly Name[],
): Record<Name, string> {
  const style = getComputedStyle(element);
  return Object.fromEntries(
    names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]),
  ) as Record<Name, string>;
}

const OF_CHARTS = [
  "muted",
  "grid",
  "main",
  "main-band",
  "main-core",
  "other",
  "other-band",
  "driven",
  "ground",
  "ground-line",
  "speed",
  "alarm",
] as const;

export type Palette = Record<(typeof OF_CHARTS)[number], string>;

export function paletteFrom(element: Element): Palette {
  return coloursOf(element, OF_CHARTS);
}
