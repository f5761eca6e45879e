/** Replay of a measured trip: the updated forecast at each position, and the naive gauge. */

import { batch, computed, effect, signal, untracked } from "@preact/signals";
import { requestUpdate } from "../api/client";
import { Latest } from "../api/latest";
import type { Forecast } from "../api/documents";
import type { UpdateRequest } from "../../generated/types";
import { arrivalBand } from "../model/arrival";
import { energySoFarWh, naiveArrival, samplesUntil } from "../model/gauge";
import { interpolate } from "../model/interpolate";
import { car } from "./car";
import { conditions } from "./conditions";
import { reportProblem, departure, mode, profile } from "./forecast";
import { forecastRequest, type Trip, trip } from "./trip";

const MIN_INTERVAL_MS = 120;
/** No update before this time. */
const MIN_OBSERVED_S = 5;

export const RATES = [30, 60, 120] as const;

export const playing = signal(false);
export const rate = signal<(typeof RATES)[number]>(60);
/** Time of the replay since departure. */
export const timeS = signal(0);
export const update = signal<Forecast | null>(null);
/** The charge on arrival as forecast at times of the trip. */
export const history = signal<ReturnType<typeof historyPointOf>[]>([]);

/** The reason why the trip cannot be replayed; null when it can. */
export const driveObstacle = computed<"notMeasured" | "otherCar" | null>(() => {
  const now = trip.value;
  if (!now?.observed) return "notMeasured";
  const other = now.vehicle !== "" && now.vehicle !== car.value?.vehicle;
  return other ? "otherCar" : null;
});
export const canDrive = computed(() => driveObstacle.value === null);
export const driving = computed(() => mode.value === "drive" && canDrive.value);
export const durationS = computed(() => trip.value?.profile.timeS.at(-1) ?? 0);
export const distanceM = computed(() => {
  const road = trip.value?.profile;
  return road ? interpolate(timeS.value, road.timeS, road.distanceM) : 0;
});
export const arrived = computed(() => durationS.value > 0 && timeS.value >= durationS.value);

/** The forecast that is shown: the latest update during a drive, else the forecast at departure. */
export const shownForecast = computed(() => (driving.value && update.value ? update.value : departure.value));

let energy: { of: Trip; wh: Float64Array | null } | null = null;

function energyOf(of: Trip): Float64Array | null {
  if (energy?.of !== of) energy = { of, wh: of.observed && energySoFarWh(of.observed) };
  return energy.wh;
}

function historyPointOf(forecast: Forecast, of: Trip) {
  const at = forecast.measured_until_s;
  const [low, high] = arrivalBand(forecast);
  const wh = energyOf(of);
  const clock = Float64Array.from(of.observed?.time_s ?? [], Number);
  return {
    timeS: at,
    distanceM: interpolate(at, of.profile.timeS, of.profile.distanceM),
    soc: forecast.soc_arrival,
    low,
    high,
    naive: wh && naiveArrival(forecast, of.profile, clock, wh),
  };
}

const runner = new Latest<{ trip: Trip; timeS: number }>(async (job, signal) => {
  const observed = samplesUntil(job.trip.observed ?? {}, job.timeS) as UpdateRequest["observed"];
  try {
    const forecast = await requestUpdate(
      { ...forecastRequest(job.trip, conditions.value, car.value), observed },
      signal,
    );
    const point = historyPointOf(forecast, job.trip);
    batch(() => {
      update.value = forecast;
      history.value = [...history.value.filter((m) => m.timeS < point.timeS), point];
    });
  } catch (error) {
    reportProblem(error);
    playing.value = false;
  }
}, MIN_INTERVAL_MS);

function reset(): void {
  runner.cancel();
  batch(() => {
    playing.value = false;
    timeS.value = 0;
    update.value = null;
    history.value = [];
  });
}

function play(): () => void {
  let frame = 0;
  let last = performance.now();
  const step = (now: number) => {
    const next = timeS.peek() + ((now - last) / 1000) * rate.peek();
    last = now;
    timeS.value = Math.min(next, durationS.peek());
    if (timeS.peek() >= durationS.peek()) playing.value = false;
    else frame = requestAnimationFrame(step);
  };
  frame = requestAnimationFrame(step);
  return () => cancelAnimationFrame(frame);
}

export function togglePlaying(): void {
  if (arrived.value) reset();
  playing.value = !playing.value;
}

export function seek(toS: number): void {
  batch(() => {
    playing.value = false;
    history.value = history.value.filter((m) => m.timeS <= toS);
    timeS.value = toS;
  });
}

export function keepDriving(): void {
  effect(() => {
    if (trip.value && conditions.value && car.value && mode.value) untracked(reset);
  });
  effect(() => {
    if (trip.value && !canDrive.value && mode.value === "drive") mode.value = "plan";
  });
  effect(() => (playing.value ? play() : undefined));
  effect(() => {
    if (!driving.value || !trip.value) return;
    const job = { trip: trip.value, timeS: timeS.value };
    if (job.timeS >= MIN_OBSERVED_S) untracked(() => runner.submit(job));
    else update.value = null;
  });
}

/** The profile that is drawn. */
export const shownProfile = computed(() => profile.value ?? trip.value?.profile ?? null);
