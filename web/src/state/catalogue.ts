/** Cars, models and examples of the service, and the choice of a trip. */

import { batch, effect, signal } from "@preact/signals";
import { listExamples, listModels, listVehicles, loadExample, readRoute } from "../api/client";
import type { ExampleSummary, Place } from "../api/documents";
import { type Car, car, chooseFirst, models, vehicles } from "./car";
import { change, type Conditions, conditions, USUAL } from "./conditions";
import { reportProblem, problem } from "./forecast";
import { loadOwnCars, ownCars } from "./own-cars";
import { readStored, writeStored } from "./preferences";
import { type End, ends, loadMap, setEnd } from "./journey";
import { type Source, type Trip, trip, tripFromExample, tripFromRoute, tripFromStops } from "./trip";

const KEY = "tripwatt.last";

interface Last {
  example: string;
  car: Car;
  conditions: Conditions;
}

export const examples = signal<ExampleSummary[]>([]);
export const source = signal<Source>("examples");
/** Documents that are loading: the examples, a trip, or a file with its name. */
export type Loading = { what: "examples" | "trip" } | { what: "file"; name: string };

/** Null when nothing is loading. */
export const loading = signal<Loading | null>({ what: "examples" });

function show(next: Trip, at: Conditions = next.start): void {
  batch(() => {
    const { reserve } = conditions.value;
    conditions.value = { ...at, reserve };
    trip.value = next;
  });
}

/** The longest example. */
function longest(rows: ExampleSummary[]): ExampleSummary | undefined {
  return [...rows].sort((a, b) => b.distance_m - a.distance_m)[0];
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

/** Plan the journey between its two ends, if both are chosen. `isDraft` while one of them is dragged. */
export function chooseJourney(isDraft = false): void {
  const { from, to } = ends.value;
  if (!from || !to) return;
  const next = tripFromStops([from, to], isDraft);
  if (trip.value?.stops) trip.value = next;
  else show(next);
}

/** Set an end on the map, and plan as soon as there are two. */
export function moveEnd(end: End, place: Place, isDraft = false): void {
  setEnd(end, place);
  chooseJourney(isDraft);
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

/**
 * Load cars, models and examples, and restore the selection of the last visit.
 *
 * With a map, the page waits for From and To; without one it shows an example.
 */
export async function startPage(): Promise<void> {
  const last = readStored<Last>(KEY);
  const withMap = await whileLoading({ what: "examples" }, loadMap);
  if (withMap) source.value = "journey";
  await whileLoading({ what: "examples" }, async () => {
    const [allModels, allVehicles, allExamples] = await Promise.all([
      listModels(),
      listVehicles(),
      withMap ? [] : listExamples(),
      loadOwnCars(),
    ]);
    batch(() => {
      models.value = allModels;
      vehicles.value = allVehicles;
      examples.value = allExamples;
      chooseFirst(
        last.car,
        ownCars.value?.map(({ name }) => name),
      );
    });
  });
  if (withMap) {
    conditions.value = { ...USUAL, ...last.conditions, motorwayMS: null };
    if (conditions.value.beforeDeparture === "logged") change({ beforeDeparture: "parked" });
    return;
  }
  const known = examples.value.find((row) => row.trip === last.example) ?? longest(examples.value);
  if (known) {
    const example = await whileLoading({ what: "trip" }, () => loadExample(known.trip));
    if (!example) return;
    const same = known.trip === last.example && last.conditions !== undefined;
    if (same) conditions.value = { ...USUAL, ...last.conditions };
    const next = tripFromExample(example);
    show(next, same ? { ...next.start, ...last.conditions } : next.start);
  }
}

/** Choose where the trip comes from; a page with a map loads the examples here, because the service has to make them. */
export function chooseSource(next: Source): void {
  source.value = next;
  if (next !== "examples" || examples.value.length > 0) return;
  void whileLoading({ what: "examples" }, async () => {
    examples.value = await listExamples();
  });
}

/** Repeat the start of the page or the forecast after a problem. */
export function retry(): void {
  problem.value = null;
  if (trip.value) conditions.value = { ...conditions.value };
  else void startPage();
}

/** Store the selection in the browser whenever it changes. */
export function keepSelectionStored(): void {
  effect(() => {
    if (!trip.value) return;
    writeStored(KEY, { example: trip.value.example, car: car.value, conditions: conditions.value });
  });
}
