/** A plan as the text of a link, and back. */

import type { Figures, Place } from "../api/documents";
import { readCoordinates } from "./road";

/** Values that a link has of the conditions, by their names. */
export type LinkValue = number | string | boolean | readonly string[] | null;

/** Places as "Vaduz@47.14,9.52". */
export function placeText({ name, latitude_deg, longitude_deg }: Place): string {
  return `${name}@${latitude_deg.toFixed(6)},${longitude_deg.toFixed(6)}`;
}

export function placeFrom(text: string): Place | null {
  const [, name = "", position = ""] = /^(.{0,200})@([^@]*)$/su.exec(text) ?? [];
  const at = readCoordinates(position);
  return at && ({ name, kind: "", ...at } as Place);
}

/** The conditions that differ from the usual ones. */
export function changedText<T extends object>(now: T, usual: T): [string, string][] {
  return (Object.entries(now) as [string, LinkValue][])
    .filter(([name, value]) => String(value) !== String(usual[name as keyof T]) && value !== null)
    .map(([name, value]) => [
      name,
      typeof value === "number" ? String(Number(value.toPrecision(8))) : String(value),
    ]);
}

/** The usual conditions with those of a link; a value of another kind than its field has is left out. */
export function changedFrom<T extends object>(
  link: URLSearchParams,
  usual: T,
  kindOf: (name: string) => "number" | "string" | "boolean" | "list",
): T {
  const changed: Record<string, LinkValue> = {};
  for (const name of Object.keys(usual)) {
    const text = link.get(name);
    if (text === null) continue;
    const kind = kindOf(name);
    if (kind === "number" && text !== "" && Number.isFinite(Number(text))) changed[name] = Number(text);
    if (kind === "boolean") changed[name] = text === "true";
    if (kind === "string") changed[name] = text;
    if (kind === "list") changed[name] = text.split(",");
  }
  return { ...usual, ...changed };
}

/** Figures of a described car. */
export function figuresFrom(text: string | null): Figures | null {
  if (text === null) return null;
  try {
    const found: unknown = JSON.parse(text);
    return typeof found === "object" ? (found as Figures | null) : null;
  } catch {
    return null;
  }
}
