/** From A to B: the places that were chosen, and the answer of the service to them. */

import { signal } from "@preact/signals";
import { getMap, planJourney } from "../api/client";
import type { Forecast, Journey, MapInfo, Place } from "../api/types";
import { car } from "./car";
import { conditions, fieldsOf } from "./conditions";
import type { Trip } from "./trip";

/** Null until the service has answered, and for a service without a map. */
export const map = signal<MapInfo | null>(null);
export const journey = signal<Journey | null>(null);

/** Ask once whether the service has a map. */
export async function loadMap(): Promise<MapInfo | null> {
  const found = await getMap();
  map.value = found.roads && found.places ? found : null;
  return map.value;
}

/** The journey between two places in the present conditions. */
export async function askJourney(from: Place, to: Place): Promise<Journey> {
  const stops = [from, to].map(({ name, latitude_deg, longitude_deg }) => ({
    name,
    latitude_deg,
    longitude_deg,
  }));
  const body = { stops, ...car.value, ...fieldsOf(conditions.value, {}) };
  return planJourney(JSON.stringify(body));
}

/** The forecast of a trip that is a journey; the other answers are kept beside it. */
export async function forecastJourney(of: Trip, body: string, signal?: AbortSignal): Promise<Forecast> {
  const found = await planJourney(body, signal);
  const [road] = found.roads;
  if (!road) throw new TypeError(of.title);
  journey.value = found;
  return road.forecast;
}
