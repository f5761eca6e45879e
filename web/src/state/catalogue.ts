/** Cars, models and examples of the service, and how a trip is chosen. */

import { batch, effect, signal } from "@preact/signals";
import { listExamples, listModels, listVehicles, loadExample, readRoute } from "../api/client";
import type { ExampleSummary } from "../api/types";
import { type Car, car, chooseFirst, models, vehicles } from "./car";
import { type Conditions, conditions } from "./conditions";
import { complain, problem } from "./forecast";
import { recall, remember } from "./preferences";
import { type Source, type Trip, trip, tripOfExample, tripOfRoute } from "./trip";

const KEY = "tripwatt.last";

interface Last {
  example: string;
  car: Car;
  conditions: Conditions;
}

export const examples = signal<ExampleSummary[]>([]);
export const source = signal<Source>("examples");
/** What is being fetched or read: the examples, a trip, or a file with its name. */
export type Loading = { what: "examples" | "trip" } | { what: "file"; name: string };

/** Null when nothing is. */
export const loading = signal<Loading | null>({ what: "examples" });

function show(next: Trip, at: Conditions = next.start): void {
  batch(() => {
    const { reserve } = conditions.value;
    conditions.value = { ...at, reserve };
    trip.value = next;
  });
}

/** The trip that has most to show. */
function longest(rows: ExampleSummary[]): ExampleSummary | undefined {
  return [...rows].sort((a, b) => b.distance_m - a.distance_m)[0];
}

async function during<T>(what: Loading, work: () => Promise<T>): Promise<T | null> {
  loading.value = what;
  try {
    return await work();
  } catch (error) {
    complain(error);
    return null;
  } finally {
    loading.value = null;
  }
}

export async function chooseExample(name: string): Promise<void> {
  const found = await during({ what: "trip" }, () => loadExample(name));
  if (found) show(tripOfExample(found));
}

/** Read an uploaded file, or pasted links, which have no name. */
export async function chooseRoute(
  content: string,
  name: string,
  from: Source,
  speedMS: number,
): Promise<void> {
  const what: Loading = name ? { what: "file", name } : { what: "trip" };
  const found = await during(what, () => readRoute(content, speedMS));
  if (found) show(tripOfRoute(found, name, from));
}

/** Fetch what the page needs to begin, and take up where the reader left. */
export async function begin(): Promise<void> {
  const last = recall<Last>(KEY);
  await during({ what: "examples" }, async () => {
    const [allModels, allVehicles, allExamples] = await Promise.all([
      listModels(),
      listVehicles(),
      listExamples(),
    ]);
    batch(() => {
      models.value = allModels;
      vehicles.value = allVehicles;
      examples.value = allExamples;
      chooseFirst(last.car);
    });
  });
  const known = examples.value.find((row) => row.trip === last.example) ?? longest(examples.value);
  if (known) {
    const found = await during({ what: "trip" }, () => loadExample(known.trip));
    if (!found) return;
    const same = known.trip === last.example && last.conditions !== undefined;
    if (same) conditions.value = last.conditions as Conditions;
    const next = tripOfExample(found);
    show(next, same ? { ...next.start, ...last.conditions } : next.start);
  }
}

/** Try again what failed: the beginning, or the forecast. */
export function retry(): void {
  problem.value = null;
  if (trip.value) conditions.value = { ...conditions.value };
  else void begin();
}

/** Keep the browser's memory in step with what is chosen. */
export function keepRemembering(): void {
  effect(() => {
    if (!trip.value) return;
    remember(KEY, { example: trip.value.example, car: car.value, conditions: conditions.value });
  });
}
