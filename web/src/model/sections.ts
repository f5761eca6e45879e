/** Sections of a road that are typed, one a line. */

import type { Quantity } from "./units";

/** Links with at least this speed have no stop [m/s]: 54 km/h. */
const OPEN_ROAD_M_S = 15;

/** An invented road: a town, country roads, a motorway over a hill, and a town. */
export const SAMPLE = "510\n1.8  30  515\n8.6  68  560\n23  120  780\n23.5  116  540\n7.8  54  490";

/**
 * Lines of length, speed and elevation at the end as links; a first line of one number is the elevation at the start.
 * A missing value stays missing for the service to name it; an end without a height has that of the end before.
 */
export function linksOf(
  typed: string,
  { distance, speed, height }: Record<"distance" | "speed" | "height", Quantity>,
): Record<string, number | null>[] {
  const numberOf = (word: string) => Number(word.replace(/,$/, "").replace(",", "."));
  const lines = typed.split("\n").map((line) =>
    line
      .split(/[;\s]+/)
      .filter(Boolean)
      .map(numberOf),
  );
  const [first, ...others] = lines.filter((line) => line.length > 0);
  const rows = first && first.length > 1 ? [first, ...others] : others;
  const known = [first, ...others].find((line) => line && line.length !== 2)?.at(-1);
  let heightM = known === undefined ? null : height.to(known);
  return rows.map(([length = Number.NaN, pace = Number.NaN, end]) => {
    const start_elevation_m = heightM;
    if (end !== undefined) heightM = height.to(end);
    const speed_m_s = speed.to(pace);
    return {
      length_m: distance.to(length),
      speed_m_s,
      ...(speed_m_s >= OPEN_ROAD_M_S && { stop_s: 0 }),
      ...(heightM !== null && { start_elevation_m, end_elevation_m: heightM }),
    };
  });
}
