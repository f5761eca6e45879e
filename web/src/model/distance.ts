/** A trip of which only distance and kind of road are known, as links: assumed shares of town, country roads and motorway. */

import type { Link } from "../api/documents";

export type Kind = "town" | "country" | "mixed" | "motorway";
export type RoadType = "town" | "country" | "motorway";

/** Mean speed of each type of road [m/s]; in towns with standstill at signals. */
export const SPEEDS_M_S: Record<RoadType, number> = {
  town: 30 / 3.6,
  country: 70 / 3.6,
  motorway: 115 / 3.6,
};

/** Share of the distance on each type of road. */
export const SHARES: Record<Kind, Record<RoadType, number>> = {
  town: { town: 1, country: 0, motorway: 0 },
  country: { town: 0.15, country: 0.85, motorway: 0 },
  mixed: { town: 0.15, country: 0.45, motorway: 0.4 },
  motorway: { town: 0.05, country: 0.1, motorway: 0.85 },
};

export const KINDS = Object.keys(SHARES) as Kind[];

/** Longest link [m]. */
const LINK_M = 1000;

/** A charge beside the one that is needed, a reserve included: what is missing, what is left at arrival, and the verdict. */
export function sufficing(
  soc: number,
  needed: number,
  reserve: number,
): { lacking: number; left: number; verdict: "good" | "open" | "bad" } {
  const left = soc - needed + reserve;
  return { lacking: needed - soc, left, verdict: soc >= needed ? "good" : left >= 0 ? "open" : "bad" };
}

/** Links of a trip from town to town: town, country road, motorway, country road, town, of unknown heights. */
export function linksOfDistance(distanceM: number, kind: Kind): Link[] {
  const { town, country, motorway } = SHARES[kind];
  const stretches: [RoadType, number][] = [
    ["town", town / 2],
    ["country", country / 2],
    ["motorway", motorway],
    ["country", country / 2],
    ["town", town / 2],
  ];
  return stretches.flatMap(([type, share]) => cut(type, share * distanceM));
}

function cut(type: RoadType, lengthM: number): Link[] {
  const count = Math.ceil(lengthM / LINK_M);
  const link: Link = {
    length_m: lengthM / count,
    speed_m_s: SPEEDS_M_S[type],
    ...(type !== "town" && { stop_s: 0 }),
  };
  return Array.from({ length: count }, () => ({ ...link }));
}
