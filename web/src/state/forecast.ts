/** Keeps the forecast in step with trip, conditions and comparison. */

import { batch, computed, effect, signal, untracked } from "@preact/signals";
import { forecast, Refused, readRoute } from "../api/client";
import { Latest } from "../api/latest";
import type { Answer, Fault, Problem } from "../api/types";
import { atMotorwaySpeed } from "../model/links";
import { type Profile, profileOf, withHeightsOf } from "../model/profile";
import { type Car, car } from "./car";
import { type Conditions, conditions } from "./conditions";
import { bodyOf, type Trip, trip } from "./trip";

/** Type of a problem that the page itself has. */
export const PAGE = "page";

const REST_MS = 50;
const USUAL_SPEED_M_S = 13.9;

export type Mode = "plan" | "compare" | "drive";

/** The one thing that is different on the other side of a comparison. */
export interface Other {
  setting: "setpointDegc" | "ambientDegc" | "payloadKg" | "soc" | "motorwayMS";
  value: number;
}

export const mode = signal<Mode>("plan");
export const other = signal<Other>({ setting: "setpointDegc", value: 18 });

/** Forecast before departure. */
export const departure = signal<Answer | null>(null);
/** The same with the other setting; null outside of a comparison. */
export const alternative = signal<Answer | null>(null);
/** What the two were asked with: the conditions on the page may have moved on. */
export const asked = signal<{ at: Conditions; other: Other }>({ at: conditions.peek(), other: other.peek() });
export const problem = signal<Problem | null>(null);
export const profile = signal<Profile | null>(null);

interface Wish {
  trip: Trip;
  at: Conditions;
  other: Other;
  compares: boolean;
  car: Car | null;
}

function problemFrom(error: unknown): Problem | null {
  if (error instanceof DOMException && error.name === "AbortError") return null;
  if (error instanceof Refused) return error.problem;
  return { type: PAGE, title: "", status: 0, detail: String(error) };
}

let profileOfSpeed: { trip: Trip; motorwayMS: number | null } | null = null;

async function renewProfile({ trip, at: { motorwayMS } }: Wish): Promise<Profile> {
  if (profile.value && profileOfSpeed?.trip === trip && profileOfSpeed.motorwayMS === motorwayMS) {
    return profile.value;
  }
  const changed = trip.links && motorwayMS !== null ? atMotorwaySpeed(trip.links, motorwayMS) : null;
  const route = changed && (await readRoute(JSON.stringify(changed), USUAL_SPEED_M_S));
  profileOfSpeed = { trip, motorwayMS };
  return route ? withHeightsOf(trip.profile, profileOf(route.samples)) : trip.profile;
}

const runner = new Latest<Wish>(async (wish, signal) => {
  const { setting, value } = wish.other;
  const otherAt = wish.compares ? { ...wish.at, [setting]: value } : null;
  try {
    const [main, second, road] = await Promise.all([
      forecast(bodyOf(wish.trip, wish.at, wish.car), signal),
      otherAt && forecast(bodyOf(wish.trip, otherAt, wish.car), signal),
      renewProfile(wish),
    ]);
    batch(() => {
      departure.value = main;
      alternative.value = second;
      asked.value = { at: wish.at, other: wish.other };
      profile.value = road;
      problem.value = null;
    });
  } catch (error) {
    const found = problemFrom(error);
    if (found) problem.value = found;
  }
}, REST_MS);

let lastTrip: Trip | null = null;

export function keepForecasting(): void {
  effect(() => {
    const now = trip.value;
    if (!now) return;
    const at = conditions.value;
    const compares = mode.value === "compare";
    if (now !== lastTrip) {
      runner.cancel();
      lastTrip = now;
      batch(() => {
        departure.value = alternative.value = profile.value = problem.value = null;
      });
    }
    const wish = { trip: now, at, other: other.value, compares, car: car.value };
    untracked(() => runner.want(wish));
  });
}

/** Show a problem that came up elsewhere. */
export function complain(error: unknown): void {
  problem.value = problemFrom(error);
}

/** Faults by the field that they belong to; those of no field on this page are in "trip". */
export const faults = computed(() => {
  const byField = new Map<string, Fault[]>();
  for (const fault of problem.value?.faults ?? []) {
    const field = FIELDS.find((name) => fault.where.startsWith(name)) ?? "trip";
    byField.set(field, [...(byField.get(field) ?? []), fault]);
  }
  return byField;
});

const FIELDS = [
  "soc",
  "displayed_soc",
  "ambient_temperature_degc",
  "cabin_setpoint_degc",
  "payload_mass_kg",
  "reserve",
  "model",
  "vehicle",
];
