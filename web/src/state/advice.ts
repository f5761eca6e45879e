/** What to do about the trip: asked once its forecast is there. */

import { effect, signal, untracked } from "@preact/signals";
import { findAdvice, findJourneyAdvice } from "../api/client";
import { Latest } from "../api/latest";
import type { Advice } from "../api/documents";
import { type Car, car } from "./car";
import { type Conditions, conditions } from "./conditions";
import { departure, mode, PROBABILITY } from "./forecast";
import { ALTERNATIVES } from "./journey";
import { forecastRequest, journeyRequest, type Trip, trip } from "./trip";

/** Advice takes a dozen forecasts: it waits until a slider rests. */
const MIN_INTERVAL_MS = 600;

export const advice = signal<Advice | null>(null);
export const adviceIsOld = signal(false);

const runner = new Latest<{ of: Trip; at: Conditions; by: Car | null }>(async ({ of, at, by }, signal) => {
  try {
    const found = of.stops
      ? await findJourneyAdvice({ ...journeyRequest(of, at, by), alternatives: ALTERNATIVES }, signal)
      : await findAdvice({ ...forecastRequest(of, at, by), probability: PROBABILITY }, signal);
    advice.value = found;
    adviceIsOld.value = runner.isWaiting;
  } catch {
    advice.value = null; // the forecast has the same faults, and shows them
  }
}, MIN_INTERVAL_MS);

/** Ask again when the forecast of the trip has changed; not while the trip is driven. */
export function keepAdvice(): void {
  effect(() => {
    const of = trip.value;
    const wanted = departure.value && of && !of.distance && !of.isDraft && mode.value === "plan";
    const job = wanted ? { of, at: conditions.value, by: car.value } : null;
    untracked(() => {
      if (!job) advice.value = null;
      adviceIsOld.value = true;
      runner.submit(job);
    });
  });
}
