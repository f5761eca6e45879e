/** Charging stations that a driver chooses, avoids or prefers. */

import type { Place, Station } from "../api/documents";
import { metresBetween, type Position } from "./road";

/** Who charges nearer than this to the start does not drive there [m]. */
export const HERE_M = 200;

/** Kind of a place on the way at which the car charges. */
export const STATION_KIND = "charging_station";

/** What a driver wants of the stations of a journey. */
export interface StationChoice {
  avoid: readonly Place[];
  /** Beginnings of the names of stations. */
  networks: readonly string[];
}

export const NO_CHOICE: StationChoice = { avoid: [], networks: [] };

/** Two positions nearer than this are one station [m]. */
const SAME_M = 30;

export function isSame(one: Position, other: Position): boolean {
  return metresBetween(one, other) <= SAME_M;
}

/** Whether a car with some plugs can use a station; what is not known fits. */
export function fits({ plugs }: Pick<Station, "plugs">, own: readonly string[]): boolean {
  return plugs.length === 0 || own.length === 0 || plugs.some(({ kind }) => own.includes(kind));
}

/** A station as a place on the way; `unnamed` is the name of one that has none. */
export function placeOfStation({ name, latitude_deg, longitude_deg }: Station, unnamed: string): Place {
  const about = { kind: STATION_KIND, context: "", also_called: "" };
  return { name: name || unnamed, ...about, latitude_deg, longitude_deg };
}

/** Where in a journey a place lengthens the way least: the number of places before it. */
export function bestPlace(places: readonly Position[], place: Position): number {
  let best = 1;
  let least = Number.POSITIVE_INFINITY;
  for (let k = 1; k < places.length; k++) {
    const [before, after] = [places[k - 1] as Position, places[k] as Position];
    const longer = metresBetween(before, place) + metresBetween(place, after) - metresBetween(before, after);
    if (longer >= least) continue;
    least = longer;
    best = k;
  }
  return best;
}

/** The network of a station: the first words of its name that another station has too, without numbers; empty if there are none. */
export function networkOf(name: string, others: readonly string[]): string {
  const words = name.split(" ");
  let most = 0;
  for (const other of others) {
    if (other === name) continue;
    const theirs = other.split(" ");
    let shared = 0;
    while (shared < words.length && words[shared] === theirs[shared]) shared++;
    most = Math.max(most, shared);
  }
  const isTwin = others.filter((other) => other === name).length > 1;
  const beginning = isTwin ? words : words.slice(0, most);
  while (/^\d+$/.test(beginning.at(-1) ?? "")) beginning.pop();
  const network = beginning.join(" ");
  return network.length > 2 ? network : "";
}

export function isPreferred(name: string, networks: readonly string[]): boolean {
  return networks.some((network) => name.toLowerCase().startsWith(network.toLowerCase()));
}
