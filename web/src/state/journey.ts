/** From A to B: the ends of the journey, the answer of the service to them, and what the map shows. */

import { computed, effect, signal, untracked } from "@preact/signals";
import { findReach, getMap, planJourney, viewMap } from "../api/client";
import { Latest } from "../api/latest";
import type { ChargingPlan, Journey, JourneyRequest, MapInfo, Place, Reach, Road } from "../api/documents";
import { type End, type Field, metresBetween, type Point, pointAlong } from "../model/road";
import { fits, isSame, NO_CHOICE, placeOfStation, type StationChoice } from "../model/stations";
import { car } from "./car";
import { type Conditions, conditions, conditionsOfJourney } from "./conditions";
import { fieldsOfCar, stopOf, type Trip, trip } from "./trip";

/** Other roads that are looked at. */
export const ALTERNATIVES = 2;
const MIN_INTERVAL_MS = 200;

/** Null until the service has answered, and for a service without roads. */
export const map = signal<MapInfo | null>(null);
export const ends = signal<Record<End, Place | null>>({ from: null, to: null });
/** Places on the way, in their order; null until one is chosen. */
export const vias = signal<(Place | null)[]>([]);
/** Time at the destination before the way back [s]; null for a journey that does not lead back. */
export const pauseS = signal<number | null>(null);
export const choice = signal<StationChoice>(NO_CHOICE);
/** Whether the journey is an example of the map that nobody asked for. */
export const isExample = signal(false);
/** The end that a click on the map sets; null for none. */
export const nextEnd = signal<End | null>("from");
export const journey = signal<Journey | null>(null);
/** Whether the answers beside the forecast are those of earlier conditions. */
export const answersAreOld = signal(false);
/** Index of the road that is shown, of those of the journey. */
export const chosenRoad = signal(0);
/** Index of the plan of charging stops that is shown, of `chargingPlans`. */
export const chosenCharging = signal(0);

/** The quickest plan with charging stops of the road that is shown, and other ones of the first road; empty where none is needed, or none found. */
export const chargingPlans = computed((): ChargingPlan[] => {
  const { charging, charging_alternatives: others = [], roads = [] } = journey.value ?? {};
  const road: Road | undefined = chosenRoad.value > 0 ? roads[chosenRoad.value] : undefined;
  if (road) return road.charging ? [road.charging] : [];
  return charging ? [charging, ...others] : [];
});
/** Whether the next journey is brought into view: one of the form, not one whose ends were placed on the map. */
export const wantsFit = signal(false);
/** Whether the next area of reach is to be fitted into view: not while a slider moves. */
export const wantsReachFit = signal(false);
export const wantsReach = signal(false);
export const reach = signal<Reach | null>(null);
export const isFindingReach = signal(false);

/** Ask once whether the service has a map. */
export async function loadMap(): Promise<MapInfo | null> {
  const world = await getMap();
  map.value = world.roads ? world : null;
  return map.value;
}

/** Set an end; the next click on the map sets the other one if it is missing. */
export function setEnd(end: End, place: Place | null): void {
  const next = { ...ends.value, [end]: place };
  ends.value = next;
  nextEnd.value = next.from ? (next.to ? null : "to") : "from";
}

/** The fields of the journey in their order. */
export function fieldsOfJourney(): Field[] {
  return ["from", ...vias.value.map((_, k): Field => `via${k}`), "to"];
}

/** The place of a field. */
export function placeOf(field: Field): Place | null {
  if (field === "from" || field === "to") return ends.value[field];
  return vias.value[Number(field.slice(3))] ?? null;
}

export function setPlace(field: Field, place: Place | null): void {
  isExample.value = false;
  if (field === "from" || field === "to") return setEnd(field, place);
  vias.value = vias.value.map((one, k) => (field === `via${k}` ? place : one));
}

/** The places of the journey in their order; null while one is missing. */
export function placesOfJourney(): Place[] | null {
  const all = fieldsOfJourney().map(placeOf);
  return all.every((place) => place !== null) ? all : null;
}

/** Whether what is shown is the journey of the form: its places may have changed since. */
export const isOfForm = computed(() => {
  const { stops, pauseS: pausedS } = trip.value ?? {};
  if (!stops) return true;
  const places = placesOfJourney();
  return (
    places?.length === stops.length &&
    pausedS === pauseS.value &&
    places.every((place, k) => isSame(place, stops[k] as Place))
  );
});

/** The points of the road at the places of the journey that is shown; null where its road is not there, or another one is written. */
export const roadPoints = computed((): Point[] | null => {
  const road = journey.value?.roads[0];
  if (!road || !trip.value?.stops || trip.value.isDraft || !isOfForm.value) return null;
  const ends = [0, ...road.stops.map(({ position_m }) => position_m), road.distance_m];
  return ends.map((positionM) => pointAlong(road.line, positionM));
});

/** A place on the map without a name. */
export function placeAt(longitude: number, latitude: number): Place {
  const wrapped = ((((longitude + 180) % 360) + 360) % 360) - 180;
  const name = `${latitude.toFixed(4)}, ${wrapped.toFixed(4)}`;
  return { name, kind: "", context: "", also_called: "", latitude_deg: latitude, longitude_deg: wrapped };
}

/** Ask for the fastest road alone, which is quick, or with alternatives and all answers. */
export async function askJourney(
  body: JourneyRequest,
  whole: boolean,
  signal?: AbortSignal,
): Promise<Journey> {
  const more = whole ? { alternatives: ALTERNATIVES } : { answers: false };
  const answer = await planJourney({ ...body, ...more }, signal);
  if (answer.roads.length === 0) throw new TypeError(JSON.stringify(body));
  return answer;
}

/** What is shown after a quick answer: alternatives and other answers are those of before, if the places are the same. */
export function mergedJourney(
  of: Trip,
  quick: Journey,
  before: { of: Trip; answer: Journey } | null,
): Journey {
  if (before?.of !== of) return quick;
  const { charging, charging_alternatives, motorway_speed_m_s, roads } = before.answer;
  return {
    ...quick,
    verdict: charging ? before.answer.verdict : quick.verdict,
    charging,
    charging_alternatives,
    motorway_speed_m_s,
    roads: [...quick.roads, ...roads.slice(1)],
  };
}

/** The charging station within 1° that is nearest by road, and the way; of an area, the three that are nearest in a straight line are tried. Null where none is known. */
export async function nearestStation(from: Place, roadTo: (to: Place) => Promise<Road | undefined>) {
  const { latitude_deg: north, longitude_deg: east } = from;
  for (const by of [0.3, 1]) {
    const view = await viewMap([north - by, east - by, north + by, east + by]).catch(() => null);
    const usable = (view?.stations ?? []).filter((one) => fits(one, journey.peek()?.plugs ?? []));
    const found = usable.map((of) => ({ of, farM: metresBetween(of, from) }));
    const near = found.sort((one, other) => one.farM - other.farM).slice(0, 3);
    // beyond the nearest side of the area, one outside of it may be nearer
    const sideM = metresBetween({ latitude_deg: north, longitude_deg: east + by }, from);
    if (!near[0] || (near[0].farM > sideM && by < 1)) continue;
    const ways = near.map(async (one) => ({ ...one, way: await roadTo(placeOfStation(one.of, "")) }));
    const lengthOf = (way?: Road) => way?.distance_m ?? Number.MAX_VALUE;
    const best = (await Promise.all(ways)).reduce((a, b) => (lengthOf(b.way) < lengthOf(a.way) ? b : a));
    if (lengthOf(best.way) <= sideM || by === 1) return best;
  }
  return null;
}

const runner = new Latest<{ from: Place; at: Conditions }>(async ({ from, at }, signal) => {
  isFindingReach.value = true;
  try {
    const body = { start: stopOf(from), ...fieldsOfCar(car.value), ...conditionsOfJourney(at) };
    reach.value = await findReach(body, signal);
  } catch {
    reach.value = null; // the forecast has the same faults, and shows them
  } finally {
    isFindingReach.value = false;
  }
}, MIN_INTERVAL_MS);

/** Find the area of reach while it is wanted, again when start, car or conditions change. */
export function keepReach(): void {
  effect(() => {
    const { from } = ends.value;
    const wanted = wantsReach.value && car.value && from ? { from, at: conditions.value } : null;
    untracked(() => {
      if (!wanted) reach.value = null;
      runner.submit(wanted);
    });
  });
}
