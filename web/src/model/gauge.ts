/** A naive gauge: the consumption so far, extrapolated to the whole trip. */

import type { Forecast, Column, Columns } from "../api/documents";
import { socFromEnergy } from "./arrival";
import { interpolate } from "./interpolate";
import type { Profile } from "./profile";

const WS_PER_WH = 3600;
const MIN_DRIVEN_M = 300;

/** Power at each sample [W], interpolated where it was not measured; null without any measurement. */
function powerOf(time: Column, voltage: Column, current: Column): number[] | null {
  const times = time.map(Number);
  const power = voltage.map((u, k) => (u === null || current[k] == null ? Number.NaN : u * current[k]));
  const known = power.flatMap((p, k) => (Number.isNaN(p) ? [] : [k]));
  if (known.length === 0) return null;
  const knownTimes = known.map((k) => times[k] as number);
  const knownPower = known.map((k) => power[k] as number);
  return power.map((p, k) => (Number.isNaN(p) ? interpolate(times[k] as number, knownTimes, knownPower) : p));
}

/** Energy since departure at each sample [Wh], by the trapezoidal rule; null without voltage and current. */
export function energySoFarWh(observed: Columns): Float64Array | null {
  const { time_s: time, voltage_v: voltage, current_a: current } = observed;
  if (!time || !voltage || !current) return null;
  const power = powerOf(time, voltage, current);
  if (!power) return null;
  const energy = new Float64Array(time.length);
  for (let k = 1; k < time.length; k++) {
    const mean = ((power[k] as number) + (power[k - 1] as number)) / 2;
    const step = (time[k] as number) - (time[k - 1] as number);
    energy[k] = (energy[k - 1] as number) + (mean * step) / WS_PER_WH;
  }
  return energy;
}

/** Charge on arrival by the naive gauge; null for the first `MIN_DRIVEN_M`. */
export function naiveArrival(
  forecast: Forecast,
  profile: Profile,
  timeS: Float64Array,
  energyWh: Float64Array,
): number | null {
  const now = forecast.measured_until_s;
  const driven = interpolate(now, profile.timeS, profile.distanceM);
  if (!(driven >= MIN_DRIVEN_M)) return null;
  const total = profile.distanceM.at(-1) as number;
  return socFromEnergy(forecast, (interpolate(now, timeS, energyWh) / driven) * total);
}

/** The samples up to a time. */
export function samplesUntil(observed: Columns, timeS: number): Columns {
  const time = observed.time_s ?? [];
  let count = 0;
  while (count < time.length && (time[count] as number) <= timeS) count++;
  return Object.fromEntries(Object.entries(observed).map(([name, column]) => [name, column.slice(0, count)]));
}
