/** What is known at the door, and what the sliders say. */

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

/** Temperatures that a log or an example says at its start. */
export interface Warmth {
  cabin_temperature_degc?: number;
  battery_temperature_degc?: number;
}

const GARAGE_DEGC = 15;

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
  // A cabin that was logged on a warm day says nothing of a cold one.
  if (some.ambientDegc !== undefined && next.door === "logged") next.door = "parked";
  conditions.value = next;
}

/** Back to what the trip says; the reserve is the reader's own. */
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
    displayed_soc: at.soc,
    ambient_temperature_degc: at.ambientDegc,
    cabin_setpoint_degc: at.setpointDegc,
    payload_mass_kg: at.payloadKg,
    reserve: at.reserve,
    ...warmthOf(at, logged),
  };
}
