/** Flags of the service as sentences. Flags of one group share a sentence; a flag with an unknown code keeps its message. */

import type { Flag } from "../api/documents";
import { FLAGS, type Words } from "../../generated/flags";
import type { Text } from "../text";
import type { Format } from "./format";
import { ENERGY, PERCENT, type Units } from "./units";

export interface Warning {
  text: string;
  /** Effect on the forecast; empty for none. */
  effect: string;
  serious: boolean;
  /** Whether the text is the English message of the service. */
  isRaw: boolean;
}

export interface Wording {
  text: Text;
  format: Format;
  units: Units;
}

type Measured = Flag & { value: number };

function isMeasured(flag: Flag): flag is Measured {
  return typeof flag.value === "number";
}

/** The old (0) or the new (-1) value of "old -> new" with its unit. */
function changed({ value, unit }: Flag, index: number): string {
  const shown = unit === "1" ? "" : unit.replace("degc", "°C");
  return `${String(value).split(" -> ").at(index)} ${shown}`.trim();
}

/** What stands in braces in the words of a flag, of its subject and text. */
const FORMS: Record<string, (flag: Flag, wording: Wording) => string> = {
  subject: ({ subject }) => subject,
  name: ({ subject }, { text }) => text.flags.names[subject] ?? subject.replaceAll("_", " "),
  old: (flag) => changed(flag, 0),
  new: (flag) => changed(flag, -1),
  hundred_metres: (_flag, { format, units }) => format.shown(100, units.height),
};

/** And of its number. */
const NUMBERS: Record<string, (value: number, format: Format, units: Units) => string> = {
  number: (value, format) => format.figure(value, 0),
  percent: (value, format) => format.shown(value, PERCENT),
  points: (value, format) => format.shown(value, PERCENT, 1),
  temperature: (value, format, { temperature }) => format.shown(value, temperature),
  speed: (value, format, { speed }) => format.shown(value, speed),
  distance: (value, format, { distance }) => format.shown(value, distance),
  kwh: (value, format) => format.shown(value, ENERGY),
  span: (value, format) => format.span(value),
};

/** The words for subject, unit, step or plural of a flag. */
function picked(
  words: Words,
  { code, subject, unit, value }: Flag,
  { format }: Wording,
  count = value,
): string {
  if (typeof words === "string") return words;
  const steps = Object.entries(FLAGS[code]?.steps ?? {}).filter(([, bound]) => bound <= Number(value));
  const plural = typeof count === "number" ? new Intl.PluralRules(format.locale).select(count) : "other";
  const step = steps.at(-1)?.[0] ?? "";
  return (
    [subject, unit, step, plural].map((key) => words[key]).find((known) => known != null) ?? words.other ?? ""
  );
}

/** One text of a flag; null when a value is missing. `parts` are those of all flags of its group. */
function filled(key: string, flag: Flag, wording: Wording, parts?: string[]): string | null {
  const words = wording.text.flags.words[flag.code] ?? {};
  let isKnown = true;
  const put = (template: string): string =>
    template.replace(/\{(\w+)\}/g, (_all, name: string) => form(name));
  const form = (name: string): string => {
    const own = words[name];
    if (own != null) return put(picked(own, flag, wording, parts?.length));
    if (name === "parts") return wording.format.list(parts ?? []);
    const number = NUMBERS[name];
    if (number && isMeasured(flag)) return number(flag.value, wording.format, wording.units);
    const made = FORMS[name]?.(flag, wording);
    isKnown &&= made != null;
    return made ?? "";
  };
  const text = put(`{${key}}`);
  return isKnown ? text : null;
}

function isWhole(texts: (string | null)[]): texts is string[] {
  return !texts.includes(null);
}

/** The warning of a group of flags; null when a value is missing. */
function warningOf(code: string, flags: Flag[], wording: Wording): Warning | null {
  const words = wording.text.flags.words[code] ?? {};
  const values = flags.filter(isMeasured).map(({ value }) => value);
  const all = { ...(flags[0] as Flag), code, value: Math.max(0, ...values) };
  const parts = words.part ? flags.map((flag) => filled("part", flag, wording)) : [];
  if (!isWhole(parts)) return null;
  const texts = words.part
    ? [filled("text", all, wording, parts)]
    : flags.map((flag) => filled("text", flag, wording));
  if (!isWhole(texts)) return null;
  const text = [...new Set(texts)].join(" ");
  return {
    text: `${text.charAt(0).toLocaleUpperCase(wording.format.locale)}${text.slice(1)}`,
    effect: words.effect ? picked(words.effect, all, wording) : "",
    serious: picked(FLAGS[code]?.severity ?? "note", all, wording) !== "note",
    isRaw: false,
  };
}

/** Warnings for flags, in the order of the catalogue; flags without a sentence come last, with their messages. */
export function warningsOf(flags: Flag[], wording: Wording): Warning[] {
  const covered = new Set<Flag>();
  const warnings: Warning[] = [];
  for (const group of Object.keys(FLAGS)) {
    const own = flags.filter(({ code }) => (FLAGS[code]?.with ?? code) === group);
    const warning = own.length > 0 ? warningOf(group, own, wording) : null;
    if (!warning) continue;
    for (const flag of own) covered.add(flag);
    warnings.push(warning);
  }
  const others = flags.filter((flag) => !covered.has(flag));
  return [
    ...warnings,
    ...others.map(({ message }) => ({ text: message, effect: "", serious: false, isRaw: true })),
  ];
}
