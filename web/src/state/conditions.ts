/** Conditions at departure, as set in the form. */

import { signal } from "@preact/signals";
import { withOffset } from "../model/clock";
import { type AskedName, CHOICES, NUMBERS, SEVERAL, type Value, valuesIn } from "../model/fields";

/** Where the temperatures of cabin and battery at departure come from. */
export const BEFORE_DEPARTURE = ["parked", "garage", "logged", "unknown"] as const;
export type BeforeDeparture = (typeof BEFORE_DEPARTURE)[number];

/** Temperatures at the start of a log or an example. */
export interface StartTemperatures {
  cabin_temperature_degc?: number;
  battery_temperature_degc?: number;
}

/** Values of the fields that the form always has; the others are unknown until they are given. */
const USUAL_VALUES = {
  ambient_temperature_degc: 10,
  cabin_setpoint_degc: 21,
  soc: 0.8,
  payload_mass_kg: 0,
  climate: "auto",
  terrain: "unknown",
} satisfies { [Name in AskedName]?: Value<Name> };

type UsualName = keyof typeof USUAL_VALUES;
type Given = { [Name in UsualName]: Value<Name> } & {
  [Name in Exclude<AskedName, UsualName>]: Value<Name> | null;
};

export interface Conditions extends Given {
  reserve: number;
  beforeDeparture: BeforeDeparture;
  /** Whether the cabin, and apart from it the battery, is warmed before departure. */
  warmCabin: boolean;
  warmBattery: boolean;
  /** Local time, such as "2026-01-12T07:30"; null for now. */
  departsAt: string | null;
  /** Whether temperature, wind and rain are those of the hour, from the weather server of the service. */
  weatherOfHour: boolean;
  /** Whether the battery is warmed on the way to a charging stop. */
  preheatForStops: boolean;
  /** Parking, plugging in and paying at each charging stop. */
  stopOverheadS: number;
  /** Speed on the motorway of a planned route; null as planned. */
  motorwayMS: number | null;
}

export const GARAGE_DEGC = 15;
/** A battery that was warmed before departure. */
export const WARM_BATTERY_DEGC = 25;

export const ASKED = [...NUMBERS, ...CHOICES, ...SEVERAL].filter(
  (name): name is AskedName => name !== "cabin_temperature_degc" && name !== "battery_temperature_degc",
);

/** Whether the form always has a value of a field. */
export function isUsual(name: string): name is UsualName {
  return name in USUAL_VALUES;
}

export const USUAL: Conditions = {
  ...(Object.fromEntries(ASKED.map((name) => [name, null])) as Record<AskedName, null>),
  ...USUAL_VALUES,
  reserve: 0.1,
  beforeDeparture: "parked",
  warmCabin: false,
  warmBattery: false,
  departsAt: null,
  weatherOfHour: false,
  preheatForStops: false,
  stopOverheadS: 300,
  motorwayMS: null,
};

export const conditions = signal<Conditions>(USUAL);

export function change(some: Partial<Conditions>): void {
  const next = { ...conditions.value, ...some };
  // Logged temperatures of cabin and battery do not apply at another outside temperature.
  if (some.ambient_temperature_degc !== undefined && next.beforeDeparture === "logged") {
    next.beforeDeparture = "parked";
  }
  conditions.value = next;
}

/** Reset to the conditions of the trip; the reserve stays. */
export function resetTo(start: Conditions): void {
  conditions.value = { ...start, reserve: conditions.value.reserve };
}

/** Conditions as far as an object of the service has them; the others are those of before. */
export function conditionsFrom(known: Record<string, unknown>, before: Conditions): Conditions {
  const values = valuesIn(known);
  return {
    ...before,
    ...Object.fromEntries(ASKED.flatMap((name) => (name in values ? [[name, values[name]]] : []))),
    motorwayMS: null,
    beforeDeparture: values.cabin_temperature_degc === undefined ? "parked" : "logged",
  };
}

export function startTemperaturesFrom(known: Record<string, unknown>): StartTemperatures {
  const { cabin_temperature_degc, battery_temperature_degc } = valuesIn(known) as StartTemperatures;
  return {
    ...(cabin_temperature_degc !== undefined && { cabin_temperature_degc }),
    ...(battery_temperature_degc !== undefined && { battery_temperature_degc }),
  };
}

function startTemperaturesOf(at: Conditions, logged: StartTemperatures): StartTemperatures {
  const warm: StartTemperatures = {
    ...(at.warmCabin && { cabin_temperature_degc: at.cabin_setpoint_degc }),
    ...(at.warmBattery && {
      battery_temperature_degc: Math.max(WARM_BATTERY_DEGC, at.ambient_temperature_degc),
    }),
  };
  if (at.beforeDeparture === "unknown") return warm;
  if (at.beforeDeparture === "logged") return { ...logged, ...warm };
  // parked outside at a temperature that only the weather server has
  if (at.beforeDeparture === "parked" && at.weatherOfHour) return warm;
  const degc = at.beforeDeparture === "garage" ? GARAGE_DEGC : at.ambient_temperature_degc;
  return { cabin_temperature_degc: degc, battery_temperature_degc: degc, ...warm };
}

/** What a weather server gives where the form does not. */
export const WEATHER: string[] = [
  "ambient_temperature_degc",
  "wind_speed_m_s",
  "wind_from_deg",
  "rain_mm_h",
  "pressure_pa",
];

/** The conditions as fields of a `ForecastRequest`; what is unknown is left out. */
export function fieldsOf(at: Conditions, logged: StartTemperatures) {
  const known = Object.fromEntries(ASKED.filter((name) => at[name] !== null).map((name) => [name, at[name]]));
  return { ...(known as Partial<Given>), reserve: at.reserve, ...startTemperaturesOf(at, logged) };
}

/** And of a request for a journey, which also has a time of departure, and the weather of its hour. */
export function conditionsOfJourney(at: Conditions) {
  const all = Object.entries(fieldsOf(at, {}));
  const asked = all.filter(([name]) => !at.weatherOfHour || !WEATHER.includes(name));
  const fields = Object.fromEntries(asked) as Partial<ReturnType<typeof fieldsOf>>;
  return { ...fields, ...(at.departsAt !== null && { departs_at: withOffset(at.departsAt) }) };
}
