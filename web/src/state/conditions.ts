/** What is known at departure, as the sliders have it. */

import { signal } from "@preact/signals";

/** How warm cabin and battery are at departure. */
export type Door = "logged" | "parked" | "garage" | "unknown";

export interface Conditions {
  ambientDegc: number;
  setpointDegc: number;
  soc: number;
  payloadKg: number;
  reserve: number;
  door: Door;
  /** Speed on the motorway of a planned road; null as planned. */
  motorwayMS: number | null;
}

/** Temperatures at the start of a log or an example. */
export interface Warmth {
  cabin_temperature_degc?: number;
  battery_temperature_degc?: number;
}

export const GARAGE_DEGC = 15;

export const USUAL: Conditions = {
  ambientDegc: 10,
  setpointDegc: 21,
  soc: 0.8,
  payloadKg: 0,
  reserve: 0.1,
  door: "parked",
  motorwayMS: null,
};

export const conditions = signal<Conditions>(USUAL);

export function change(some: Partial<Conditions>): void {
  const next = { ...conditions.value, ...some };
  // The cabin temperature of a warm day does not hold on a cold one.
  if (some.ambientDegc !== undefined && next.door === "logged") next.door = "parked";
  conditions.value = next;
}

/** Back to the conditions of the trip; the reserve stays. */
export function resetTo(start: Conditions): void {
  conditions.value = { ...start, reserve: conditions.value.reserve };
}

function warmthOf({ door, ambientDegc }: Conditions, logged: Warmth): Warmth {
  if (door === "unknown") return {};
  if (door === "logged") return logged;
  const degc = door === "garage" ? GARAGE_DEGC : ambientDegc;
  return { cabin_temperature_degc: degc, battery_temperature_degc: degc };
}

/** The fields of a `ForecastRequest` that the conditions decide. */
export function fieldsOf(at: Conditions, logged: Warmth) {
  return {
    soc: at.soc,
    ambient_temperature_degc: at.ambientDegc,
    cabin_setpoint_degc: at.setpointDegc,
    payload_mass_kg: at.payloadKg,
    reserve: at.reserve,
    ...warmthOf(at, logged),
  };
}
