/** Flags of the service as sentences. Flags of one group share a sentence; a flag with an unknown code keeps its message. */

import type { Flag, Terrain } from "../api/documents";
import type { Text } from "../text";
import type { Format } from "./format";
import { ENERGY, PERCENT, type Units } from "./units";

/** Distances from the training range, in standard deviations. */
const CLEARLY_OUTSIDE_SD = 1;
const FAR_OUTSIDE_SD = 3;

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

interface Group {
  codes: readonly string[];
  /** Null when a value is missing. */
  toWarning: (flags: Flag[], wording: Wording) => Partial<Warning> | null;
}

/** The first letter in upper case. */
function capitalised(words: string, { format }: Wording): string {
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

/** A group of one flag whose sentence contains its value. */
function byValue(
  code: string,
  toWarning: (value: number, wording: Wording, subject: string) => Partial<Warning>,
): Group {
  return {
    codes: [code],
    toWarning: ([flag], wording) => (isMeasured(flag) ? toWarning(flag.value, wording, flag.subject) : null),
  };
}

/** A group of one flag without a value. */
function plain(code: string, toWarning: (text: Text["flags"]) => Partial<Warning>): Group {
  return { codes: [code], toWarning: (_flags, { text }) => toWarning(text.flags) };
}

/** Flags whose values are durations, as one part of a sentence each. */
function durationTexts<Code extends string>(
  flags: Flag[],
  { format }: Wording,
  texts: Record<Code, (time: string) => string>,
): string[] | null {
  if (!allMeasured(flags)) return null;
  return flags.map(({ code, value }) => texts[code as Code](format.span(value)));
}

/** Groups in the order in which they are shown. */
const GROUPS: Group[] = [
  {
    codes: ["outside_training"],
    toWarning: (flags, wording) => {
      const furthest = Math.max(0, ...flags.filter(isMeasured).map(({ value }) => value));
      const beyond = furthest < FAR_OUTSIDE_SD ? "clear" : "far";
      const distance = furthest < CLEARLY_OUTSIDE_SD ? "slight" : beyond;
      const { outside, wider } = wording.text.flags;
      return {
        text: outside(capitalised(namesOf(flags, wording), wording), flags.length, distance),
        effect: wider,
        serious: furthest >= CLEARLY_OUTSIDE_SD,
      };
    },
  },
  {
    codes: ["usual_value_assumed"],
    toWarning: (flags, wording) => {
      const { usualValue, wider } = wording.text.flags;
      const { format, units } = wording;
      const assumed = flags.map((flag) =>
        isMeasured(flag)
          ? `${nameOf(flag.subject, wording)} (${format.shown(flag.value, units.temperature)})`
          : nameOf(flag.subject, wording),
      );
      return { text: usualValue(format.list(assumed)), effect: wider };
    },
  },
  byValue("soc_assumed", (soc, { text, format }) => ({
    text: text.flags.socAssumed(format.shown(soc, PERCENT)),
  })),
  {
    codes: ["no_trips_of_car"],
    toWarning: ([flag], { text }) => ({
      text: text.flags.noTripsOfCar(flag?.subject ?? ""),
      effect: text.flags.wider,
      serious: true,
    }),
  },
  {
    codes: ["changed_car"],
    toWarning: (flags, { text, format }) => {
      const changes = flags.map(({ subject, value, unit }) => {
        if (typeof value === "number") return text.flags.moreChanges(value);
        const [known = "", changed = ""] = String(value).split(" -> ");
        return text.flags.change(subject, changed, known, unit === "1" ? "" : unit);
      });
      return { text: text.flags.changedCar(format.list(changes)), effect: text.flags.wider, serious: true };
    },
  },
  byValue("outside_classes", (mass, { text, format }, subject) => ({
    text: (subject === "lighter" ? text.flags.lighterThanAll : text.flags.heavierThanAll)(
      format.figure(mass, 0),
    ),
    effect: text.flags.outsideClasses,
    serious: true,
  })),
  plain("no_elevation", (text) => ({ text: text.noElevation })),
  {
    codes: ["unknown_climb"],
    toWarning: ([flag], { text, format, units }) =>
      isMeasured(flag)
        ? {
            text: text.flags.unknownClimb(
              text.flags.countries[flag.subject as Terrain] ?? text.flags.countries.unknown,
              format.shown(100, units.height),
              format.shown(flag.value, PERCENT, 1),
            ),
            serious: flag.subject !== "flat",
          }
        : null,
  },
  byValue("wind_direction_unknown", (speed, { text, format, units }) => ({
    text: text.flags.windDirectionUnknown(format.shown(speed, units.speed)),
    effect: text.flags.wider,
  })),
  plain("free_flow_times", (text) => ({ text: text.freeFlowTimes })),
  plain("travel_time_error_unknown", (text) => ({
    text: text.timeErrorUnknown,
    effect: text.routeErrorUnknownEffect,
  })),
  plain("no_stations", (text) => ({ text: text.noStations })),
  plain("no_stop_found", (text) => ({ text: text.noStopFound })),
  plain("class_charging_curve", (text) => ({ text: text.classCurve })),
  plain("map_ends", (text) => ({ text: text.mapEnds })),
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
    toWarning: (flags, wording) => {
      const { limits, cannotFollow, cannotFollowEffect } = wording.text.flags;
      const parts = durationTexts(flags, wording, limits);
      return (
        parts && { text: cannotFollow(wording.format.list(parts)), effect: cannotFollowEffect, serious: true }
      );
    },
  },
  byValue("battery_empty", (missingWh, { text, format }) => ({
    text: text.flags.batteryEmpty(format.shown(missingWh, ENERGY)),
    serious: true,
  })),
  byValue("battery_full", (lostWh, { text, format }) => ({
    text: text.flags.batteryFull(format.shown(lostWh, ENERGY)),
  })),
  {
    codes: ["battery_over_voltage"],
    toWarning: (flags, wording) => {
      const parts = durationTexts(flags, wording, wording.text.flags.states);
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
    toWarning: (flags, wording) => {
      const { text, format, units } = wording;
      if (!allMeasured(flags)) return null;
      const sentences = flags.map(({ subject, value }) =>
        text.flags.fileValue(nameOf(subject, wording), format.shown(value, units.temperature)),
      );
      return { text: sentences.join(" ") };
    },
  },
  plain("elevation_interpolated", (text) => ({ text: text.elevationInterpolated })),
  plain("elevation_relative", (text) => ({ text: text.elevationRelative })),
  plain("times_interpolated", (text) => ({ text: text.timesInterpolated })),
  plain("gap_bridged", (text) => ({ text: text.gapBridged })),
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

/** Codes with a sentence. */
export const CODES: ReadonlySet<string> = new Set(GROUPS.flatMap(({ codes }) => codes));

/** Warnings for flags, in the order of the groups; flags without a sentence come last, with their messages. */
export function warningsOf(flags: Flag[], wording: Wording): Warning[] {
  const covered = new Set<Flag>();
  const warnings: Warning[] = [];
  for (const { codes, toWarning } of GROUPS) {
    const own = flags.filter(({ code }) => codes.includes(code));
    const warning = own.length > 0 ? toWarning(own, wording) : null;
    if (!warning) continue;
    for (const flag of own) covered.add(flag);
    warnings.push({ ...PLAIN, ...warning });
  }
  const others = flags.filter((flag) => !covered.has(flag));
  return [...warnings, ...others.map(({ message }) => ({ ...PLAIN, text: message, isRaw: true }))];
}
