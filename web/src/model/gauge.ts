/** What the car's own gauge would say: consumption so far times what is left of the road. */

import type { Answer, Columns } from "../api/types";
import { socFromEnergy } from "./arrival";
import { interpolate } from "./interpolate";
import type { Profile } from "./profile";

const WS_PER_WH = 3600;
const LEAST_M = 300;

/** Energy since departure at each sample [Wh]; null without voltage and current. */
export function energySoFarWh(observed: Columns): Float64Array | null {
  const { time_s: time, voltage_v: voltage, current_a: current } = observed;
  if (!time || !voltage || !current) return null;
  const energy = new Float64Array(time.length);
  for (let k = 1; k < time.length; k++) {
    const power = ((voltage[k] ?? 0) * (current[k] ?? 0) + (voltage[k - 1] ?? 0) * (current[k - 1] ?? 0)) / 2;
    const step = (time[k] as number) - (time[k - 1] as number);
    energy[k] = (energy[k - 1] as number) + (power * step) / WS_PER_WH;
  }
  return energy;
}

/** Charge at the end by the naive gauge; null before there is anything to go by. */
export function naiveArrival(
  answer: Answer,
  profile: Profile,
  timeS: Float64Array,
  energyWh: Float64Array,
): number | null {
  const now = answer.measured_until_s;
  const driven = interpolate(now, profile.timeS, profile.distanceM);
  if (!(driven >= LEAST_M)) return null;
  const total = profile.distanceM.at(-1) as number;
  return socFromEnergy(answer, (interpolate(now, timeS, energyWh) / driven) * total);
}

/** The samples up to a time, as a body of JSON takes them. */
export function until(observed: Columns, timeS: number): Columns {
  const time = observed.time_s ?? [];
  let count = 0;
  while (count < time.length && (time[count] as number) <= timeS) count++;
  return Object.fromEntries(Object.entries(observed).map(([name, column]) => [name, column.slice(0, count)]));
}
