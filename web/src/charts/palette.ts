/** Colours by their names in the style sheet, as the theme resolves them. */

export function coloursOf<Name extends string>(
  element: Element,
  names: readonly Name[],
): Record<Name, string> {
  const probe = element.appendChild(document.createElement("i"));
  const resolved = names.map((name) => {
    probe.style.color = `var(--${name})`;
    return [name, getComputedStyle(probe).color];
  });
  probe.remove();
  return Object.fromEntries(resolved) as Record<Name, string>;
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
