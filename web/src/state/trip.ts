/** The trip that is looked at, wherever it came from. */

import { signal } from "@preact/signals";
import type { Columns, Example, Link, Route } from "../api/types";
import { atMotorwaySpeed } from "../model/links";
import { type Profile, profileOf } from "../model/profile";
import { type Conditions, fieldsOf, USUAL, type Warmth } from "./conditions";

const ROAD = ["time_s", "speed_m_s", "elevation_m", "grade"];
const MEASURED = ["time_s", "voltage_v", "current_a", "soc", "displayed_soc"];
const FULL_SOC = 1;

export type Source = "examples" | "upload" | "links";

export interface Trip {
  /** Name of the example; empty for what the reader brought. */
  example: string;
  source: Source;
  title: string;
  note: string;
  notes: string[];
  /** The speed trace as JSON, made once: sliders do not change it. Empty for a planned road. */
  samplesJson: string;
  links: Link[] | null;
  profile: Profile;
  observed: Columns | null;
  logged: Warmth;
  /** What the log or the example says of the conditions. */
  start: Conditions;
}

export const trip = signal<Trip | null>(null);

function pick(columns: Columns, names: string[]): Columns {
  return Object.fromEntries(Object.entries(columns).filter(([name]) => names.includes(name)));
}

function conditionsFrom(known: Record<string, unknown>): Conditions {
  const number = (name: string, usual: number) =>
    typeof known[name] === "number" ? (known[name] as number) : usual;
  return {
    ...USUAL,
    ambientDegc: number("ambient_temperature_degc", USUAL.ambientDegc),
    setpointDegc: number("cabin_setpoint_degc", USUAL.setpointDegc),
    soc: Math.min(number("displayed_soc", USUAL.soc), FULL_SOC),
    payloadKg: number("payload_mass_kg", USUAL.payloadKg),
    door: typeof known.cabin_temperature_degc === "number" ? "logged" : "parked",
  };
}

function warmthFrom(known: Record<string, unknown>): Warmth {
  const names = ["cabin_temperature_degc", "battery_temperature_degc"] as const;
  return Object.fromEntries(names.filter((n) => typeof known[n] === "number").map((n) => [n, known[n]]));
}

export function tripOfExample(example: Example): Trip {
  const { samples, ...known } = example.request;
  return {
    example: example.trip,
    source: "examples",
    title: example.title,
    note: example.note,
    notes: [],
    samplesJson: JSON.stringify(samples),
    links: null,
    profile: profileOf(samples),
    observed: example.observed,
    logged: warmthFrom(known),
    start: conditionsFrom(known),
  };
}

function isMeasured(columns: Columns): boolean {
  return ("voltage_v" in columns && "current_a" in columns) || "soc" in columns || "displayed_soc" in columns;
}

export function tripOfRoute(route: Route, title: string, source: Source): Trip {
  const first = Object.fromEntries(Object.entries(route.samples).map(([name, column]) => [name, column[0]]));
  const measured = pick(route.samples, MEASURED);
  return {
    example: "",
    source,
    title,
    note: route.links ? "planned road" : "speed trace",
    notes: route.notes,
    samplesJson: route.links ? "" : JSON.stringify(pick(route.samples, ROAD)),
    links: route.links,
    profile: profileOf(route.samples),
    observed: isMeasured(measured) ? measured : null,
    logged: warmthFrom(first),
    start: conditionsFrom(first),
  };
}

/** Body of a request for a forecast, and with what was `observed` of an update. */
export function bodyOf(of: Trip, at: Conditions, model: string | null, observed?: Columns): string {
  const fields = { ...(model && { model }), ...fieldsOf(at, of.logged), ...(observed && { observed }) };
  const road = of.links
    ? `"links":${JSON.stringify(atMotorwaySpeed(of.links, at.motorwayMS))}`
    : `"samples":${of.samplesJson}`;
  return `{${road},${JSON.stringify(fields).slice(1)}`;
}
