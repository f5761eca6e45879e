/** A trip of which only distance and kind of road are known, as links: assumed shares of town, country roads and motorway. */

import type { Link, Need } from "../api/documents";
import { ROADS } from "../../generated/roads";
import type { Verdict } from "./arrival";

export type Kind = "city" | "country" | "mixed" | "motorway";
export type RoadType = "town" | "country" | "motorway";

/** Share of the distance on each type of road, of a trip of up to `ROADS.town_m`. */
const SHARES: Record<Kind, Record<RoadType, number>> = ROADS.shares;

export const KINDS: Kind[] = ["city", "country", "mixed", "motorway"];

/** Share of a distance on each type of road: a longer trip has no more town, unless it is all town. */
export function sharesOver(distanceM: number, kind: Kind): Record<RoadType, number> {
  const { town: most, country, motorway } = SHARES[kind];
  if (most === 1) return SHARES[kind];
  const town = most * Math.min(ROADS.town_m / distanceM, 1);
  const rest = (1 - town) / (1 - most);
  return { town, country: country * rest, motorway: motorway * rest };
}

/** Longest link [m]. */
const LINK_M = 1000;

type Sufficient = Pick<Need, "soc_needed" | "reserve" | "energy_wh" | "energy_quantile_wh">;

/** A charge beside the one that is needed, a reserve included: what is missing, what is left at arrival and expected there, and the verdict. */
export function sufficing(
  soc: number,
  { soc_needed: needed, reserve, energy_wh, energy_quantile_wh }: Sufficient,
) {
  const left = soc - needed + reserve;
  const expected = soc - ((needed - reserve) * energy_wh) / energy_quantile_wh;
  const verdict: Verdict = soc >= needed ? "good" : Math.min(expected - reserve, left) >= 0 ? "open" : "bad";
  return { arrival: Math.max(expected, 0), lacking: needed - soc, left, verdict };
}

/** Links of a trip from town to town: town, country road, motorway, country road, town, of unknown heights. */
export function linksOfDistance(distanceM: number, kind: Kind): Link[] {
  const { town, country, motorway } = sharesOver(distanceM, kind);
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
    speed_m_s: ROADS.speeds_m_s[type],
    ...(type !== "town" && { stop_s: 0 }),
  };
  return Array.from({ length: count }, () => ({ ...link }));
}
