/** Cars, models and examples of the service, and the choice of a trip. */

import { batch, signal } from "@preact/signals";
import { listExamples, listModels, listVehicles, loadExample, readRoute, viewMap } from "../api/client";
import type { ExampleSummary, Place } from "../api/documents";
import type { Kind } from "../model/distance";
import { type Field, metresBetween } from "../model/road";
import { bestPlace, isSame, type StationChoice } from "../model/stations";
import { chooseFirst, models, vehicles } from "./car";
import { type Conditions, conditions, resetTo, USUAL } from "./conditions";
import { reportProblem, problem } from "./forecast";
import { loadOwnCars, ownCars } from "./own-cars";
import {
  choice,
  ends,
  isExample,
  loadMap,
  map,
  nextEnd,
  pauseS,
  placesOfJourney,
  setPlace,
  vias,
  wantsFit,
} from "./journey";
import { lastLink, type Linked, readLink } from "./link";
import {
  type Source,
  type Trip,
  trip,
  tripFromDistance,
  tripFromExample,
  tripFromRoute,
  tripFromStops,
} from "./trip";

export const examples = signal<ExampleSummary[]>([]);
export const source = signal<Source>("examples");
/** Documents that are loading: the examples, a trip, or a file with its name. */
export type Loading = { what: "examples" | "trip" } | { what: "file"; name: string };

/** Null when nothing is loading. */
export const loading = signal<Loading | null>({ what: "examples" });

function show(next: Trip, at: Conditions = next.start): void {
  batch(() => {
    conditions.value = { ...at, reserve: conditions.value.reserve };
    trip.value = next;
  });
}

async function whileLoading<T>(what: Loading, load: () => Promise<T>): Promise<T | null> {
  loading.value = what;
  try {
    return await load();
  } catch (error) {
    reportProblem(error);
    return null;
  } finally {
    loading.value = null;
  }
}

export async function chooseExample(name: string): Promise<void> {
  const example = await whileLoading({ what: "trip" }, () => loadExample(name));
  if (example) show(tripFromExample(example));
}

/** Plan the journey, if all its places are chosen. `isDraft` while an end is dragged. */
export function chooseJourney(isDraft = false): void {
  const places = placesOfJourney();
  if (!places) return;
  const next = tripFromStops(places, pauseS.value, choice.value, isDraft);
  if (trip.value?.stops) trip.value = next;
  else show(next);
}

/** Set a place of the journey on the map, and plan as soon as there are all. */
export function move(field: Field, place: Place, isDraft = false): void {
  setPlace(field, place);
  chooseJourney(isDraft);
}

/** Charge at a station on the way: where it lengthens the journey least. */
export function stopAt(station: Place): void {
  const places = placesOfJourney();
  if (!places) return;
  const at = bestPlace(pauseS.value !== null ? [...places, places[0] as Place] : places, station);
  batch(() => {
    isExample.value = false;
    const index = Math.min(at - 1, vias.value.length);
    vias.value = [...vias.value.slice(0, index), station, ...vias.value.slice(index)];
    choose({ avoid: choice.value.avoid.filter((one) => !isSame(one, station)) });
  });
}

/** Drive past a place on the way. */
export function passBy(station: Place): void {
  vias.value = vias.value.filter((one) => !one || !isSame(one, station));
  chooseJourney();
}

/** Change which stations are wanted, and plan again. */
export function choose(change: Partial<StationChoice>): void {
  choice.value = { ...choice.value, ...change };
  chooseJourney();
}

/** Begin a journey of one's own at a place on the map, or with an empty field. */
export function beginAt(place: Place | null): void {
  batch(() => {
    isExample.value = false;
    ends.value = { from: place, to: null };
    nextEnd.value = place ? "to" : "from";
  });
}

/** Plan a journey from its first field on. */
export function beginJourney(): void {
  if (map.value) chooseSource("journey");
  batch(() => {
    beginAt(null);
    vias.value = [];
    trip.value = null;
  });
}

/** Answer what a distance needs. */
export function chooseDistance(distanceM: number, kind: Kind): void {
  show(tripFromDistance(distanceM, kind));
}

/** Read an uploaded file, links or a distance; `name` is empty for links. `speedMS` is 0 where none is needed. */
export async function chooseRoute(
  content: string,
  name: string,
  from: Source,
  speedMS: number,
): Promise<void> {
  const what: Loading = name ? { what: "file", name } : { what: "trip" };
  const route = await whileLoading(what, () => readRoute(content, speedMS));
  if (route) show(tripFromRoute(route, name, from));
}

/** The file that was read last, to be read again at another speed. */
export const uploaded = signal<{ content: string; name: string } | null>(null);

/** Read a file; `speedMS` is the speed of a track without times. */
export async function chooseUpload(file: { content: string; name: string }, speedMS: number): Promise<void> {
  uploaded.value = file;
  await chooseRoute(file.content, file.name, "upload", speedMS);
}

/** Farther than this apart, two settlements make an example [m]. */
const EXAMPLE_M = 5000;
/** Of so many of the largest ones. */
const EXAMPLE_OF = 12;

/** Two of the largest settlements of the map, apart from each other; null where it names fewer. */
async function exampleOfMap(): Promise<[Place, Place] | null> {
  const bounds = map.value?.bounds_deg;
  if (bounds?.length !== 4) return null;
  const { settlements } = await viewMap(bounds as [number, number, number, number]);
  const [first, ...others] = settlements.slice(0, EXAMPLE_OF);
  if (!first) return null;
  const farM = (other: Place) => metresBetween(first, other);
  const apart = others.sort((one, other) => farM(one) - farM(other));
  const second = apart.find((other) => farM(other) > EXAMPLE_M) ?? apart.at(-1);
  return second ? [first, second] : null;
}

/** Show an example of the map, so that nobody begins with a bare one. */
async function chooseExampleOfMap(): Promise<void> {
  const pair = await whileLoading({ what: "trip" }, exampleOfMap);
  if (!pair || trip.value) return;
  batch(() => {
    ends.value = { from: pair[0], to: pair[1] };
    nextEnd.value = "from";
    isExample.value = wantsFit.value = true;
    chooseJourney();
  });
}

/** Show a link: the car, the conditions and the trip that it has; false where the service does not have the trip. */
export async function chooseLink({ source: from, places, distance, ...linked }: Linked): Promise<boolean> {
  batch(() => {
    if (linked.car) chooseFirst(linked.car, ownCars.value ?? []);
    conditions.value = linked.conditions;
  });
  if (from === "journey" && map.value && places) {
    batch(() => {
      source.value = "journey";
      ends.value = { from: places[0] as Place, to: places.at(-1) as Place };
      vias.value = places.slice(1, -1);
      pauseS.value = linked.pauseS;
      choice.value = linked.choice;
      nextEnd.value = null;
      isExample.value = false;
      wantsFit.value = true;
      trip.value = tripFromStops(places, linked.pauseS, linked.choice, false);
    });
    return true;
  }
  if (from === "distance" && distance) {
    source.value = "distance";
    trip.value = tripFromDistance(distance.distanceM, distance.kind);
    return true;
  }
  if (from !== "examples") return false;
  await loadExamples();
  if (!examples.value.some((row) => row.trip === linked.example)) return false;
  const found = await whileLoading({ what: "trip" }, () => loadExample(linked.example));
  if (!found) return false;
  source.value = "examples";
  trip.value = tripFromExample(found);
  return true;
}

async function loadExamples(): Promise<void> {
  if (examples.value.length > 0) return;
  await whileLoading({ what: "examples" }, async () => {
    examples.value = await listExamples();
  });
}

/** Show the longest example, unless there is a trip by then. */
async function chooseFirstExample(): Promise<void> {
  await loadExamples();
  const [first] = [...examples.value].sort((one, other) => other.distance_m - one.distance_m);
  if (first && source.value === "examples" && !trip.value) await chooseExample(first.trip);
}

/**
 * Load cars, models and examples, and show the trip of the link, else that of the last visit.
 *
 * Where there is none, the page shows an example: of the map, where there is a map.
 */
export async function startPage(): Promise<void> {
  const linked = readLink(location.hash) ?? lastLink();
  const withMap = await whileLoading({ what: "examples" }, loadMap);
  if (withMap) source.value = "journey";
  await whileLoading({ what: "examples" }, async () => {
    const [allModels, allVehicles] = await Promise.all([listModels(), listVehicles(), loadOwnCars()]);
    batch(() => {
      models.value = allModels;
      vehicles.value = allVehicles;
      chooseFirst(undefined, ownCars.value ?? []);
    });
  });
  if (models.value.length === 0) return;
  if (linked && (await chooseLink(linked))) return;
  return withMap ? chooseExampleOfMap() : chooseFirstExample();
}

/** The trips that were shown last, by where they come from. */
const earlier = new Map<Source, Trip>();

/** Choose where the trip comes from; what is shown is the last trip from there, and never one from elsewhere. */
export function chooseSource(next: Source): void {
  const now = trip.value;
  if (next === source.value) return;
  batch(() => {
    if (now) earlier.set(now.source, now);
    const isUnchanged =
      now?.source === "examples" &&
      JSON.stringify({ ...now.start, reserve: conditions.value.reserve }) ===
        JSON.stringify(conditions.value);
    if (isUnchanged) resetTo(USUAL);
    source.value = next;
    problem.value = null;
    trip.value = earlier.get(next) ?? null;
  });
  if (next === "examples") void chooseFirstExample();
}

/** Repeat the start of the page or the forecast after a problem. */
export function retry(): void {
  problem.value = null;
  if (trip.value) conditions.value = { ...conditions.value };
  else if (models.value.length === 0) void startPage();
}
