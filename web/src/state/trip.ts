/** The trip that is looked at, wherever it came from. */

import { signal } from "@preact/signals";
import type { Columns, Example, Link, Route } from "../api/types";
import { atMotorwaySpeed } from "../model/links";
import { type Profile, profileOf } from "../model/profile";
import type { Car } from "./car";
import { type Conditions, fieldsOf, USUAL, type Warmth } from "./conditions";

const ROAD = ["time_s", "speed_m_s", "elevation_m", "grade"];
const MEASURED = ["time_s", "voltage_v", "current_a", "soc", "displayed_soc"];
const FULL_SOC = 1;

export type Source = "examples" | "upload" | "links";

export interface Trip {
  /** Name of the example; empty for what the reader brought. */
  example: string;
  source: Source;
  /** The car that was measured; empty where nobody says. */
  vehicle: string;
  title: string;
  note: string;
  notes: string[];
  /** What no slider changes, as members of a JSON object, made once: the speed trace, or the heights of links. */
  fixedJson: string;
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

function membersOf(object: object): string {
  return JSON.stringify(object).slice(1, -1);
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
    vehicle: example.vehicle,
    title: example.title,
    note: example.note,
    notes: [],
    fixedJson: membersOf({ samples }),
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
  const links = route.links ?? null;
  const first = Object.fromEntries(Object.entries(route.samples).map(([name, column]) => [name, column[0]]));
  const measured = pick(route.samples, MEASURED);
  return {
    example: "",
    source,
    vehicle: "",
    title,
    note: links ? `${links.length} ${links.length === 1 ? "link" : "links"}` : "speed trace",
    notes: route.notes,
    fixedJson: membersOf(
      links ? { elevation: route.elevation ?? null } : { samples: pick(route.samples, ROAD) },
    ),
    links,
    profile: profileOf(route.samples),
    observed: isMeasured(measured) ? measured : null,
    logged: warmthFrom(first),
    start: conditionsFrom(first),
  };
}

/** Body of a request for a forecast, and with what was `observed` of an update. */
export function bodyOf(of: Trip, at: Conditions, car: Car | null, observed?: Columns): string {
  const road = of.links && { links: atMotorwaySpeed(of.links, at.motorwayMS) };
  const fields = {
    ...road,
    ...car,
    ...fieldsOf(at, of.logged),
    ...(observed && { observed }),
  };
  return `{${of.fixedJson},${membersOf(fields)}}`;
}
