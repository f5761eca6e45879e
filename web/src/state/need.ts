/** Without a road: what a distance needs, and how far the charge goes. */

import { batch, computed, effect, signal, untracked } from "@preact/signals";
import { findNeed, findRange } from "../api/client";
import { Latest } from "../api/latest";
import type { Need, Range } from "../api/documents";
import type { Kind } from "../model/distance";
import { type Car, car } from "./car";
import { type Conditions, conditions, fieldsOf } from "./conditions";
import { PROBABILITY, problem, reportProblem } from "./forecast";
import { fieldsOfCar, trip } from "./trip";

const MIN_INTERVAL_MS = 80;

export const need = signal<Need | null>(null);
export const range = signal<Range | null>(null);
export const needIsOld = signal(false);

interface NeedJob {
  distanceM: number;
  kind: Kind;
  at: Conditions;
  car: Car | null;
}

function carQuery(of: Car | null): object {
  const { car: by, ...model } = fieldsOfCar(of);
  return typeof by === "object" ? { ...model, car: JSON.stringify(by) } : { ...model, car: by };
}

const runner = new Latest<NeedJob>(async ({ distanceM, kind, at, car: by }, signal) => {
  const { reserve, ...fields } = fieldsOf(at, {});
  const common = { ...fields, ...carQuery(by) };
  try {
    const [needed, far] = await Promise.all([
      findNeed({ ...common, distance_km: distanceM / 1000, kind, probability: PROBABILITY, reserve }, signal),
      findRange({ ...common, kind, reserve }, signal),
    ]);
    batch(() => {
      need.value = needed;
      range.value = far;
      needIsOld.value = false;
      problem.value = null;
    });
  } catch (error) {
    need.value = range.value = null;
    reportProblem(error);
  }
}, MIN_INTERVAL_MS);

const asked = computed(() => trip.value?.distance ?? null);

/** Ask while a distance is the trip, again when distance, car or conditions change. */
export function keepNeed(): void {
  effect(() => {
    const distance = asked.value;
    const job = distance && { ...distance, at: conditions.value, car: car.value };
    untracked(() => {
      if (!job) need.value = range.value = null;
      needIsOld.value = true;
      runner.submit(job);
    });
  });
}
