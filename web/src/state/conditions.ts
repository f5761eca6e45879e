/** Conditions at departure, as set with the sliders. */

import { signal } from "@preact/signals";
import type { ClimateMode, Terrain } from "../api/documents";

/** Where the temperatures of cabin and battery at departure come from. */
export type BeforeDeparture = "logged" | "parked" | "garage" | "unknown";

export interface Conditions {
  ambientDegc: number;
  setpointDegc: number;
  soc: number;
  payloadKg: number;
  reserve: number;
  climate: ClimateMode;
  /** Country of a road whose heights are unknown. */
  terrain: Terrain;
  beforeDeparture: BeforeDeparture;
  /** Speed on the motorway of a planned route; null as planned. */
  motorwayMS: number | null;
}

/** Temperatures at the start of a log or an example. */
export interface StartTemperatures {
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
  climate: "auto",
  terrain: "unknown",
  beforeDeparture: "parked",
  motorwayMS: null,
};

export const conditions = signal<Conditions>(USUAL);

export function change(some: Partial<Conditions>): void {
  const next = { ...conditions.value, ...some };
  // Logged temperatures of cabin and battery do not apply at another outside temperature.
  if (some.ambientDegc !== undefined && next.beforeDeparture === "logged") next.beforeDeparture = "parked";
  conditions.value = next;
}

/** Reset to the conditions of the trip; the reserve stays. */
export function resetTo(start: Conditions): void {
  conditions.value = { ...start, reserve: conditions.value.reserve };
}

function startTemperaturesOf(
  { beforeDeparture, ambientDegc }: Conditions,
  logged: StartTemperatures,
): StartTemperatures {
  if (beforeDeparture === "unknown") return {};
  if (beforeDeparture === "logged") return logged;
  const degc = beforeDeparture === "garage" ? GARAGE_DEGC : ambientDegc;
  return { cabin_temperature_degc: degc, battery_temperature_degc: degc };
}

/** The conditions as fields of a `ForecastRequest`. */
export function fieldsOf(at: Conditions, logged: StartTemperatures) {
  return {
    soc: at.soc,
    ambient_temperature_degc: at.ambientDegc,
    cabin_setpoint_degc: at.setpointDegc,
    payload_mass_kg: at.payloadKg,
    reserve: at.reserve,
    climate: at.climate,
    terrain: at.terrain,
    ...startTemperaturesOf(at, logged),
  };
}
