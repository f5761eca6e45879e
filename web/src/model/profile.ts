/** Speed and elevation along the way. */

import type { Columns } from "../api/documents";
import { interpolate } from "./interpolate";

export interface Profile {
  timeS: Float64Array;
  distanceM: Float64Array;
  speedMS: Float64Array;
  /** Null when no elevation is known. */
  elevationM: Float64Array | null;
}

function numbers(column: (number | null)[]): Float64Array {
  return Float64Array.from(column, (value) => value ?? Number.NaN);
}

export function profileFromSamples(samples: Columns): Profile {
  const timeS = numbers(samples.time_s ?? []);
  const speedMS = numbers(samples.speed_m_s ?? []);
  const distanceM = new Float64Array(timeS.length);
  for (let k = 1; k < timeS.length; k++) {
    const step = (timeS[k] as number) - (timeS[k - 1] as number);
    const mean = ((speedMS[k] as number) + (speedMS[k - 1] as number)) / 2;
    distanceM[k] = (distanceM[k - 1] as number) + (Number.isFinite(mean) ? mean * step : 0);
  }
  const elevation = samples.elevation_m;
  const known = elevation?.some((value) => value !== null);
  return { timeS, distanceM, speedMS, elevationM: elevation && known ? numbers(elevation) : null };
}

/** What a road climbs and descends in all [m]. */
export function climbsOf(elevationM: Float64Array): [number, number] {
  let [upM, downM] = [0, 0];
  for (let k = 1; k < elevationM.length; k++) {
    const stepM = (elevationM[k] as number) - (elevationM[k - 1] as number);
    upM += Math.max(stepM, 0);
    downM += Math.max(-stepM, 0);
  }
  return [upM, downM];
}

/** A profile of the same route at another speed, with the elevation of the first profile. */
export function withElevationOf({ distanceM, elevationM }: Profile, driven: Profile): Profile {
  if (!elevationM) return driven;
  return { ...driven, elevationM: driven.distanceM.map((x) => interpolate(x, distanceM, elevationM)) };
}
