/** An invented planned route as an example: a town, country roads, a motorway over a hill, and a town. */

import type { Link } from "../api/documents";
import { OPEN_ROAD_M_S } from "./link-rows";

const LINK_M = 900;
const START_M = 510;

/** Length [m], speed [m/s], elevation at the end [m]. */
const STRETCHES: [number, number, number][] = [
  [1800, 8.5, 515],
  [2400, 12, 528],
  [6200, 22, 560],
  [14000, 33.3, 655],
  [9000, 33.3, 780],
  [12500, 33.3, 610],
  [11000, 30.5, 540],
  [5200, 19.5, 498],
  [2600, 9.5, 490],
];

function linksOf(length: number, speed: number, fromM: number, toM: number): Link[] {
  const count = Math.round(length / LINK_M);
  const height = (k: number) => Math.round(fromM + ((toM - fromM) * k) / count);
  return Array.from({ length: count }, (_, k) => ({
    length_m: Math.round(length / count),
    speed_m_s: speed,
    ...(speed >= OPEN_ROAD_M_S && { stop_s: 0 }),
    start_elevation_m: height(k),
    end_elevation_m: height(k + 1),
  }));
}

/** The example. */
export function sampleLinks(): Link[] {
  return STRETCHES.flatMap(([length, speed, endM], k) =>
    linksOf(length, speed, STRETCHES[k - 1]?.[2] ?? START_M, endM),
  );
}
