/** The service's flags as sentences. Flags of one group share a sentence; an unknown code is shown by its message. */

import type { Flag } from "../api/types";
import type { Text } from "../text";
import type { Format } from "./format";
import { PERCENT, type Units } from "./units";

/** Beyond the training range by so many standard deviations. */
const CLEARLY_OUTSIDE_SD = 1;
const FAR_OUTSIDE_SD = 3;

export interface Warning {
  text: string;
  /** What it does to the forecast; empty for nothing. */
  effect: string;
  serious: boolean;
  /** Whether the text is the service's own, in English. */
  isRaw: boolean;
}

export interface Wording {
  text: Text;
  format: Format;
  units: Units;
}

interface Group {
  codes: readonly string[];
  /** Null for what the group cannot word. */
  tell: (flags: Flag[], wording: Wording) => Partial<Warning> | null;
}

/** The first letter in upper case. */
function sentence(words: string, { format }: Wording): string {
  return `${words.charAt(0).toLocaleUpperCase(format.locale)}${words.slice(1)}`;
}

function nameOf(field: string, { text }: Wording): string {
  const names: Record<string, string> = text.flags.fields;
  return names[field] ?? field.replaceAll("_", " ");
}

function namesOf(flags: Flag[], wording: Wording): string {
  return wording.format.list(flags.map(({ subject }) => nameOf(subject, wording)));
}

type Measured = Flag & { value: number };

function isMeasured(flag: Flag | undefined): flag is Measured {
  return typeof flag?.value === "number";
}

function allMeasured(flags: Flag[]): flags is Measured[] {
  return flags.every(isMeasured);
}

/** A group of one flag with a value, told by that value. */
function byValue(
  code: string,
  tell: (value: number, wording: Wording, subject: string) => Partial<Warning>,
): Group {
  return {
    codes: [code],
    tell: ([flag], wording) => (isMeasured(flag) ? tell(flag.value, wording, flag.subject) : null),
  };
}

/** A group of one flag without a value. */
function plain(code: string, tell: (text: Text["flags"]) => Partial<Warning>): Group {
  return { codes: [code], tell: (_flags, { text }) => tell(text.flags) };
}

/** Flags that tell for how long something lasted, one part of a sentence each. */
function lasting<Code extends string>(
  flags: Flag[],
  { format }: Wording,
  texts: Record<Code, (time: string) => string>,
): string[] | null {
  if (!allMeasured(flags)) return null;
  return flags.map(({ code, value }) => texts[code as Code](format.span(value)));
}

/** In the order in which they are shown. */
const GROUPS: Group[] = [
  {
    codes: ["outside_training"],
    tell: (flags, wording) => {
      const furthest = Math.max(0, ...flags.filter(isMeasured).map(({ value }) => value));
      const beyond = furthest < FAR_OUTSIDE_SD ? "clear" : "far";
      const distance = furthest < CLEARLY_OUTSIDE_SD ? "slight" : beyond;
      const { outside, wider } = wording.text.flags;
      return {
        text: outside(sentence(namesOf(flags, wording), wording), flags.length, distance),
        effect: wider,
        serious: furthest >= CLEARLY_OUTSIDE_SD,
      };
    },
  },
  {
    codes: ["usual_value_assumed"],
    tell: (flags, wording) => {
      const { usualValue, wider } = wording.text.flags;
      return { text: usualValue(namesOf(flags, wording), flags.length), effect: wider };
    },
  },
  byValue("soc_assumed", (soc, { text, format }) => ({
    text: text.flags.socAssumed(format.shown(soc, PERCENT)),
  })),
  {
    codes: ["no_trips_of_car"],
    tell: ([flag], { text }) => ({
      text: text.flags.noTripsOfCar(flag?.subject ?? ""),
      effect: text.flags.wider,
      serious: true,
    }),
  },
  plain("no_elevation", (text) => ({ text: text.noElevation, effect: text.noElevationEffect })),
  plain("route_error_unknown", (text) => ({
    text: text.routeErrorUnknown,
    effect: text.routeErrorUnknownEffect,
    serious: true,
  })),
  byValue("links_too_long", (metres, { text, format, units }) => ({
    text: text.flags.linksTooLong(format.shown(metres, units.distance)),
    effect: text.flags.linksTooLongEffect,
  })),
  {
    codes: ["motor_torque_limit", "motor_power_limit", "motor_speed_limit", "battery_voltage_floor"],
    tell: (flags, wording) => {
      const { limits, cannotFollow, cannotFollowEffect } = wording.text.flags;
      const parts = lasting(flags, wording, limits);
      return (
        parts && { text: cannotFollow(wording.format.list(parts)), effect: cannotFollowEffect, serious: true }
      );
    },
  },
  {
    codes: ["battery_empty", "battery_over_full", "battery_over_voltage"],
    tell: (flags, wording) => {
      const parts = lasting(flags, wording, wording.text.flags.states);
      return parts && { text: parts.join(" ") };
    },
  },
  plain("battery_not_settled", (text) => ({
    text: text.notSettled,
    effect: text.notSettledEffect,
    serious: true,
  })),
  {
    codes: ["file_value_kept"],
    tell: (flags, wording) => {
      const { text, format, units } = wording;
      if (!allMeasured(flags)) return null;
      const told = flags.map(({ subject, value }) =>
        text.flags.fileValue(nameOf(subject, wording), format.shown(value, units.temperature)),
      );
      return { text: told.join(" ") };
    },
  },
  plain("elevation_interpolated", (text) => ({ text: text.elevationInterpolated })),
  plain("elevation_relative", (text) => ({ text: text.elevationRelative })),
  plain("times_interpolated", (text) => ({ text: text.timesInterpolated })),
  plain("times_ignored", (text) => ({ text: text.timesIgnored })),
  byValue("speed_assumed", (speed, { text, format, units }) => ({
    text: text.flags.speedAssumed(format.shown(speed, units.speed)),
  })),
  byValue("first_of_several", (count, { text }, subject) => {
    const { routes, tracks } = text.flags.firstOfSeveral;
    return { text: (subject === "routes" ? routes : tracks)(count) };
  }),
  byValue("geometries_skipped", (count, { text }) => ({ text: text.flags.geometriesSkipped(count) })),
];

const PLAIN: Warning = { text: "", effect: "", serious: false, isRaw: false };

/** Codes that have a sentence of their own. */
export const CODES: ReadonlySet<string> = new Set(GROUPS.flatMap(({ codes }) => codes));

/** What the flags say, in the order of the groups; what no group words comes last, by its message. */
export function warningsOf(flags: Flag[], wording: Wording): Warning[] {
  const told = new Set<Flag>();
  const warnings: Warning[] = [];
  for (const { codes, tell } of GROUPS) {
    const own = flags.filter(({ code }) => codes.includes(code));
    const warning = own.length > 0 ? tell(own, wording) : null;
    if (!warning) continue;
    for (const flag of own) told.add(flag);
    warnings.push({ ...PLAIN, ...warning });
  }
  const others = flags.filter((flag) => !told.has(flag));
  return [...warnings, ...others.map(({ message }) => ({ ...PLAIN, text: message, isRaw: true }))];
}
