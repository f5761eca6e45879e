/** What is shown of the trip as a whole: of its road, or of its plan with charging stops. */

import { computed, effect, signal } from "@preact/signals";
import type { Course, Stop } from "../api/documents";
import { type Answer, answerOf, answerWithStops, decisiveChance, riskyStop } from "../model/answer";
import { verdictOf } from "../model/arrival";
import { interpolate } from "../model/interpolate";
import { distanceNear, type Point, positionNear } from "../model/road";
import { HERE_M, isSame } from "../model/stations";
import { chargingPlan, ways } from "./charging";
import { conditions } from "./conditions";
import { driving, shownForecast } from "./drive";
import { forecastIsOld, problem, requested } from "./forecast";
import { answersAreOld, chosenRoad, isOfForm, journey, map } from "./journey";
import { needIsOld } from "./need";
import { trip } from "./trip";

/** Whether the plan begins with charging where the journey begins. */
export const chargesHere = computed(() => (chargingPlan.value?.stops[0]?.position_m ?? HERE_M) < HERE_M);

/** The stop that the plan which is shown may not reach with the reserve. */
export const stopInDoubt = computed((): Stop | null => chargingPlan.value && riskyStop(chargingPlan.value));

/** The stop whose charge is shown before that at the end: the one in doubt, or that with the least charge of all. */
export const lowestStop = computed((): Stop | null => {
  const { stops = [], soc_arrival: end = 0 } = chargingPlan.value ?? {};
  const [least] = [...stops].sort((one, other) => one.soc_arrival - other.soc_arrival);
  return stopInDoubt.value ?? (least && least.soc_arrival < end ? least : null);
});

export const answer = computed((): Answer | null => {
  if (chargingPlan.value) return answerWithStops(chargingPlan.value);
  const now = shownForecast.value;
  const own = now && answerOf(now, requested.value.at.reserve);
  const road = trip.value?.stops ? journey.value?.roads[chosenRoad.value] : undefined;
  const pausedS = road ? road.duration_s - (road.forecast.series.time_s.at(-1) as number) : 0;
  return own && { ...own, drivingS: own.drivingS + pausedS };
});

/** Whether what is shown is of other places than those that are written in the form, and not planned yet. */
export const isOfOtherPlaces = computed(() => !isOfForm.value && !trip.value?.isDraft);

/** Whether charging stops, or a slow way to one, are still being looked for. */
export const isLookingForStops = computed(() => {
  const now = answer.value;
  if (ways.value === undefined) return true;
  if (!now || chargingPlan.value || !trip.value?.stops || !answersAreOld.value) return false;
  if (problem.value || !isOfForm.value || map.value?.stations === 0) return false;
  return !trip.value.isDraft && verdictOf(decisiveChance(now)) !== "good";
});

/** An answer that takes longer is called old [ms]: one that follows a slider does not flicker. */
const LATE_MS = 400;

const isOld = computed(() => {
  if (problem.value || !trip.value) return false;
  if (trip.value.distance) return needIsOld.value;
  return forecastIsOld.value || (chargingPlan.value !== null && answersAreOld.value);
});

/** Whether what is shown is of earlier conditions, and has been for a while. */
export const isLate = signal(false);

export function keepLate(): void {
  effect(() => {
    isLate.value = false;
    if (!isOld.value) return;
    const timer = setTimeout(() => {
      isLate.value = true;
    }, LATE_MS);
    return () => clearTimeout(timer);
  });
}

/** Charge along the way, of the plan with stops or of the forecast. */
export const course = computed((): Course | null => {
  if (chargingPlan.value) return chargingPlan.value.course;
  const now = shownForecast.value;
  return (
    now && {
      position_m: now.series.distance_m,
      time_s: now.series.time_s,
      displayed_soc: now.series.displayed_soc,
      low: now.series.displayed_soc_low,
      high: now.series.displayed_soc_high,
    }
  );
});

export type Turn = NonNullable<typeof turn.value>;

/** Where a journey that ends at its start turns, and the charge on arrival there. */
export const turn = computed(() => {
  const { stops, pauseS = null } = trip.value ?? {};
  const [first, last] = [stops?.[0], stops?.at(-1)];
  const isLoop = pauseS === null && first && last && isSame(first, last);
  const place = pauseS !== null || isLoop ? stops?.at(isLoop ? -2 : -1) : undefined;
  const [road, plan] = [journey.value?.roads[chosenRoad.value], chargingPlan.value];
  if (!place || !road || !course.value) return null;
  const point: Point = [place.longitude_deg, place.latitude_deg];
  const nearM = plan ? positionNear(plan, point) : distanceNear(road, point); // with the detours to stops
  // who charges in the pause arrives before
  const atM = Math.min(
    nearM,
    ...(plan?.stops ?? []).filter((one) => one.pause_s > 0).map((one) => one.position_m),
  );
  const { position_m, time_s, displayed_soc } = course.value;
  const after = position_m.findIndex((positionM) => positionM >= atM);
  const k = position_m[after] === atM ? after : after - 1; // the pause is between two rows
  const { position_m: along = [], elevation_m: heights = [] } = road.elevation ?? {};
  const riseM =
    heights.length > 0 ? interpolate(distanceNear(road, point), along, heights) - (heights[0] ?? 0) : 0;
  return {
    name: place.name,
    position_m: atM,
    soc: displayed_soc[k] ?? 0,
    atS: time_s[k] ?? 0,
    pauseS,
    riseM,
  };
});

/** Charging stops and turn of the journey that is shown, in the order of time. */
export const halts = computed(() => {
  const all = [...(turn.value ? [turn.value] : []), ...(chargingPlan.value?.stops ?? [])];
  return all.sort((one, other) => one.position_m - other.position_m);
});

/** Clock times of departure and arrival; without a chosen time, of a departure now. */
export const clock = computed(() => {
  const now = answer.value;
  if (!now || driving.value) return null;
  const { departsAt } = conditions.value;
  const leaves = departsAt === null ? new Date() : new Date(departsAt);
  return {
    leaves,
    arrives: new Date(leaves.getTime() + (now.drivingS + now.chargingS) * 1000),
    isNow: departsAt === null,
  };
});
