/** Replays a measured trip: the forecast at each place, beside the naive gauge. */

import { batch, computed, effect, signal, untracked } from "@preact/signals";
import { forecastUpdate } from "../api/client";
import { Latest } from "../api/latest";
import type { Answer } from "../api/types";
import { arrivalBand } from "../model/arrival";
import { energySoFarWh, naiveArrival, until } from "../model/gauge";
import { interpolate } from "../model/interpolate";
import { car } from "./car";
import { conditions } from "./conditions";
import { complain, departure, mode, profile } from "./forecast";
import { bodyOf, type Trip, trip } from "./trip";

const REST_MS = 120;
/** An update needs samples to go by. */
const LEAST_S = 5;

export const RATES = [30, 60, 120] as const;

/** The forecast of the arrival at one moment of the trip. */
export interface Moment {
  timeS: number;
  distanceM: number;
  soc: number;
  low: number;
  high: number;
  naive: number | null;
}

export const playing = signal(false);
export const rate = signal<(typeof RATES)[number]>(60);
/** Where the car is, in time since departure. */
export const timeS = signal(0);
export const update = signal<Answer | null>(null);
export const history = signal<Moment[]>([]);

/** Why the trip cannot be driven; null when it can. */
export const whyNoDrive = computed<"notMeasured" | "otherCar" | null>(() => {
  const now = trip.value;
  if (!now?.observed) return "notMeasured";
  const other = now.vehicle !== "" && now.vehicle !== car.value?.vehicle;
  return other ? "otherCar" : null;
});
export const canDrive = computed(() => whyNoDrive.value === null);
export const driving = computed(() => mode.value === "drive" && canDrive.value);
export const durationS = computed(() => trip.value?.profile.timeS.at(-1) ?? 0);
export const distanceM = computed(() => {
  const road = trip.value?.profile;
  return road ? interpolate(timeS.value, road.timeS, road.distanceM) : 0;
});
export const arrived = computed(() => durationS.value > 0 && timeS.value >= durationS.value);

/** What the page shows: the forecast of now while driving, else that of the departure. */
export const answer = computed(() => (driving.value && update.value ? update.value : departure.value));

interface Wish {
  trip: Trip;
  timeS: number;
}

let energy: { of: Trip; wh: Float64Array | null } | null = null;

function energyOf(of: Trip): Float64Array | null {
  if (energy?.of !== of) energy = { of, wh: of.observed && energySoFarWh(of.observed) };
  return energy.wh;
}

function momentOf(said: Answer, of: Trip): Moment {
  const at = said.measured_until_s;
  const [low, high] = arrivalBand(said);
  const wh = energyOf(of);
  const clock = Float64Array.from(of.observed?.time_s ?? [], Number);
  return {
    timeS: at,
    distanceM: interpolate(at, of.profile.timeS, of.profile.distanceM),
    soc: said.soc_arrival,
    low,
    high,
    naive: wh && naiveArrival(said, of.profile, clock, wh),
  };
}

const runner = new Latest<Wish>(async (wish, signal) => {
  const measured = until(wish.trip.observed ?? {}, wish.timeS);
  try {
    const said = await forecastUpdate(bodyOf(wish.trip, conditions.value, car.value, measured), signal);
    const moment = momentOf(said, wish.trip);
    batch(() => {
      update.value = said;
      history.value = [...history.value.filter((m) => m.timeS < moment.timeS), moment];
    });
  } catch (error) {
    complain(error);
    playing.value = false;
  }
}, REST_MS);

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
    const wish = { trip: trip.value, timeS: timeS.value };
    if (wish.timeS >= LEAST_S) untracked(() => runner.want(wish));
    else update.value = null;
  });
}

/** The road that is drawn. */
export const road = computed(() => profile.value ?? trip.value?.profile ?? null);
