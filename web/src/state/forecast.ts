/** Forecasts for the trip, the conditions and the comparison, renewed when these change. */

import { batch, computed, effect, signal, untracked } from "@preact/signals";
import {
  findDifference,
  findJourneyDifference,
  requestForecast,
  RequestFailed,
  readRoute,
} from "../api/client";
import { Latest } from "../api/latest";
import type { Difference, Forecast, Fault, Journey, LeaveWith, Problem, Whole } from "../api/documents";
import { atMotorwaySpeed } from "../model/links";
import { type Profile, profileFromSamples, withElevationOf } from "../model/profile";
import { type Car, car } from "./car";
import { ASKED, type Conditions, conditions } from "./conditions";
import {
  ALTERNATIVES,
  answersAreOld,
  askJourney,
  chosenCharging,
  chosenRoad,
  journey,
  mergedJourney,
} from "./journey";
import { forecastRequest, journeyRequest, type Trip, trip } from "./trip";

/** Type of a problem for an unexpected error of the page. */
export const PAGE_ERROR = "page";

const MIN_INTERVAL_MS = 50;
const USUAL_SPEED_M_S = 13.9;
/** Of "leave with": 19 of 20 trips. */
export const PROBABILITY = 0.95;

/** Places that a journey may have. */
export const MOST_STOPS = 20;

export type Mode = "plan" | "compare" | "drive";

/** The setting that differs in the second forecast of a comparison, with its value. */
export interface Other {
  setting: "cabin_setpoint_degc" | "ambient_temperature_degc" | "payload_mass_kg" | "soc" | "motorwayMS";
  value: number;
}

export const mode = signal<Mode>("plan");
export const other = signal<Other>({ setting: "cabin_setpoint_degc", value: 18 });

/** Forecast at departure. */
export const departure = signal<Forecast | null>(null);
/** Forecast with the other setting; null outside of a comparison. */
export const alternative = signal<Forecast | null>(null);
/** Both journeys of a comparison with their stops to charge; null where neither has stops, or until they are there. */
export const wholes = signal<[Whole, Whole] | null>(null);
/** The second forecast less the first; null until it is there. */
export const difference = signal<Difference | null>(null);
/** Conditions of the two forecasts; those on the page may have changed since. */
export const requested = signal<{ at: Conditions; other: Other }>({
  at: conditions.peek(),
  other: other.peek(),
});
/** The charge to leave with, on a trip that is no journey. */
export const leaving = signal<LeaveWith | null>(null);
/** Whether the conditions have changed since. */
export const leavingIsOld = signal(false);
/** Whether the forecast is of earlier conditions. */
export const forecastIsOld = signal(false);
export const problem = signal<Problem | null>(null);
export const profile = signal<Profile | null>(null);

interface ForecastJob {
  trip: Trip;
  at: Conditions;
  other: Other;
  compares: boolean;
  car: Car | null;
}

function problemFrom(error: unknown): Problem | null {
  if (error instanceof DOMException && error.name === "AbortError") return null;
  if (error instanceof RequestFailed) return error.problem;
  return { type: PAGE_ERROR, title: "", status: 0, detail: String(error) };
}

let profileOfSpeed: { trip: Trip; motorwayMS: number | null } | null = null;

async function renewProfile({ trip, at: { motorwayMS } }: ForecastJob): Promise<Profile> {
  if (profile.value && profileOfSpeed?.trip === trip && profileOfSpeed.motorwayMS === motorwayMS) {
    return profile.value;
  }
  const changed = trip.links && motorwayMS !== null ? atMotorwaySpeed(trip.links, motorwayMS) : null;
  const route = changed && (await readRoute(JSON.stringify(changed), USUAL_SPEED_M_S));
  profileOfSpeed = { trip, motorwayMS };
  return route ? withElevationOf(trip.profile, profileFromSamples(route.samples)) : trip.profile;
}

/** The journey that was last shown with all answers. */
let whole: { of: Trip; answer: Journey } | null = null;

function roadOf({ roads }: Journey): Journey["roads"][number] {
  return roads[chosenRoad.value] ?? (roads[0] as Journey["roads"][number]);
}

function showRoad(): void {
  if (!journey.value) return;
  const { forecast, samples } = roadOf(journey.value);
  departure.value = forecast;
  profile.value = profileFromSamples(samples);
}

/** Show another road of the journey. */
export function chooseRoad(index: number): void {
  batch(() => {
    chosenRoad.value = index;
    chosenCharging.value = 0;
    showRoad();
  });
}

/** First the fastest road, which is quick; then the other answers, unless the conditions change meanwhile. */
async function runJourney(job: ForecastJob, otherAt: Conditions | null, signal: AbortSignal): Promise<void> {
  const body = journeyRequest(job.trip, job.at, job.car);
  const askOther = async (at: Conditions) =>
    roadOf(await askJourney(journeyRequest(job.trip, at, job.car), chosenRoad.value > 0, signal)).forecast;
  const show = (answer: Journey, isWhole: boolean, second: Forecast | null) =>
    batch(() => {
      journey.value = isWhole ? answer : mergedJourney(job.trip, answer, whole);
      answersAreOld.value = !isWhole;
      alternative.value = second;
      if (!isWhole || chosenRoad.value > 0) difference.value = null;
      wholes.value = null;
      requested.value = { at: job.at, other: job.other };
      problem.value = null;
      forecastIsOld.value = runner.isWaiting;
      showRoad();
    });
  const compare = async () => {
    if (!otherAt || runner.isWaiting) return;
    const road = chosenRoad.value;
    const [other, one] = [job.at, otherAt].map((at) => ({
      ...journeyRequest(job.trip, at, job.car),
      ...(road > 0 && { alternatives: ALTERNATIVES }),
    }));
    if (one && other) difference.value = await findJourneyDifference({ one, other, road }, signal);
  };
  const second = otherAt && (await askOther(otherAt));
  if (whole?.of !== job.trip) chosenRoad.value = chosenCharging.value = 0;
  if (chosenRoad.value === 0) {
    show(await askJourney(body, false, signal), false, second);
    await compare();
  }
  if (job.trip.isDraft || runner.isWaiting) return;
  const answer = await askJourney(body, true, signal);
  whole = { of: job.trip, answer };
  show(answer, true, second);
  if (chosenRoad.value > 0) await compare();
  if (!otherAt || runner.isWaiting) return;
  const alternate = await askJourney(journeyRequest(job.trip, otherAt, job.car), true, signal);
  const pair: [Whole, Whole] = [roadOf(answer).whole, roadOf(alternate).whole];
  if (pair.some(({ charges }) => charges > 0)) wholes.value = pair;
}

const runner = new Latest<ForecastJob>(async (job, signal) => {
  const { setting, value } = job.other;
  const otherAt = job.compares ? { ...job.at, [setting]: value } : null;
  const ask = (at: Conditions) => requestForecast(forecastRequest(job.trip, at, job.car), signal);
  try {
    if (job.trip.stops) return await runJourney(job, otherAt, signal);
    const [main, second, road] = await Promise.all([ask(job.at), otherAt && ask(otherAt), renewProfile(job)]);
    batch(() => {
      departure.value = main;
      alternative.value = second;
      requested.value = { at: job.at, other: job.other };
      profile.value = road;
      problem.value = null;
      difference.value = wholes.value = null;
      leavingIsOld.value = true;
      forecastIsOld.value = runner.isWaiting;
    });
    if (runner.isWaiting) return;
    if (otherAt) {
      const [other, one] = [job.at, otherAt].map((at) => forecastRequest(job.trip, at, job.car));
      if (one && other) difference.value = await findDifference({ one, other }, signal);
    }
    const body = { ...forecastRequest(job.trip, job.at, job.car), probability: PROBABILITY };
    const { leave_with } = await requestForecast(body, signal);
    batch(() => {
      leaving.value = leave_with;
      leavingIsOld.value = false;
    });
  } catch (error) {
    const failure = problemFrom(error);
    if (!failure) return;
    batch(() => {
      problem.value = failure;
      // nothing of another journey stays up, but while an end is dragged over what has no road
      if (job.trip.stops && !job.trip.isDraft && whole?.of !== job.trip) {
        journey.value = departure.value = profile.value = null;
      }
    });
  }
}, MIN_INTERVAL_MS);

function clear(): void {
  departure.value = alternative.value = profile.value = leaving.value = journey.value = null;
}

let lastTrip: Trip | null = null;

export function keepForecasting(): void {
  effect(() => {
    const now = trip.value;
    if (!now) {
      // nothing of a trip that was left stays up
      runner.cancel();
      lastTrip = null;
      return batch(clear);
    }
    const at = conditions.value;
    const compares = mode.value === "compare";
    if (now !== lastTrip) {
      const moves = now.stops !== null && lastTrip?.stops != null;
      if (!(now.isDraft && lastTrip?.isDraft)) runner.cancel();
      lastTrip = now;
      if (!moves) {
        batch(() => {
          clear();
          problem.value = null;
        });
      }
    }
    if (now.distance) return;
    const job = { trip: now, at, other: other.value, compares, car: car.value };
    forecastIsOld.value = true;
    untracked(() => runner.submit(job));
  });
}

/** Show an error as a problem. */
export function reportProblem(error: unknown): void {
  problem.value = problemFrom(error);
}

/** Name of the field of a place in faults. */
export function stopField(index: number): string {
  return `stops[${index}]`;
}

/** Take back the faults of a stop that is being changed. */
export function forgetStop(index: number): void {
  const at = stopField(index);
  if (problem.value?.faults?.some(({ where }) => where.startsWith(at))) problem.value = null;
}

/** Faults by field; faults of fields without a control on the page are under "trip". */
export const faults = computed(() => {
  const byField = new Map<string, Fault[]>();
  for (const fault of problem.value?.faults ?? []) {
    const field = FIELDS.find((name) => fault.where.startsWith(name)) ?? "trip";
    byField.set(field, [...(byField.get(field) ?? []), fault]);
  }
  return byField;
});

const FIELDS = [
  ...Array.from({ length: MOST_STOPS }, (_, k) => `stops[${k}]`),
  ...ASKED,
  "reserve",
  "model",
  "car",
  "consumption_kwh_per_100km",
];
