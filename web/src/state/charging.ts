/** The plan with charging stops that is shown: who may not reach its first stop as usual drives there slowly. */

import { computed, effect, signal, untracked } from "@preact/signals";
import { requestForecast } from "../api/client";
import { Latest } from "../api/latest";
import type { ChargingPlan, Place, Road, Station, Stop } from "../api/documents";
import { BELOW } from "../model/answer";
import { atMotorwaySpeed } from "../model/links";
import { chanceThere, slowed, type Ways } from "../model/slow-way";
import { HERE_M, placeOfStation } from "../model/stations";
import { car } from "./car";
import { type Conditions, conditions } from "./conditions";
import { mode } from "./forecast";
import { askJourney, chargingPlans, chosenCharging, journey } from "./journey";
import { forecastRequest, journeyRequest, type Trip, trip } from "./trip";

/** A slow speed on a road, of a driver who may not get to a station [m/s]. */
export const GENTLE_M_S = 60 / 3.6;

/** From this chance on nobody has to drive slowly. */
const CERTAIN = 0.95;

/** Who has less, or less than the reserve, is no longer asked to leave with more. */
const LOW_SOC = 0.2;

/** The way to a place from the start of the journey, or from another one. */
export async function wayTo(to: Place, at = conditions.value, from = trip.value?.stops?.[0]) {
  const stops = [from as Place, { ...to, kind: "" }];
  const body = journeyRequest({ ...(trip.value as Trip), stops, pauseS: null }, at, car.value);
  return (await askJourney(body, false).catch(() => null))?.roads[0];
}

/** The way to a station as usual, and slowly without heating and air conditioning. */
export async function waysTo(to: Station): Promise<Ways> {
  const at: Conditions = { ...conditions.value, climate: "off" };
  const { links, elevation, forecast: usual } = (await wayTo(placeOfStation(to, ""))) as Road;
  const slow = atMotorwaySpeed(links, GENTLE_M_S, GENTLE_M_S);
  const way = { ...(trip.value as Trip), links: slow, fixed: { elevation } };
  return { usual, slow: await requestForecast(forecastRequest(way, at, car.value)) };
}

/** With the way to the first stop as usual: of a journey whose road needs one. */
export const usualPlan = computed((): ChargingPlan | null => {
  if (!trip.value?.stops || mode.value !== "plan") return null;
  return chargingPlans.value[chosenCharging.value] ?? chargingPlans.value[0] ?? null;
});

/** Whether the car leaves now with so little that it is not asked to leave with more. */
export const isLow = computed(() => {
  const { reserve, soc, departsAt } = conditions.value;
  return departsAt === null && soc < Math.max(reserve, LOW_SOC);
});

/** The ways to the first stop of a plan that a car with little charge may not reach; undefined while they are looked for. */
export const ways = signal<Ways | null | undefined>(null);

const reserve = () => (journey.value?.verdict.reason === BELOW ? 0 : conditions.value.reserve);

/** Whether the way to the first stop is the slow one. */
export const isSlow = computed(() => {
  const [first] = usualPlan.value?.stops ?? [];
  return !!first && !!ways.value && first.p_reach < chanceThere(ways.value.slow, reserve());
});

export const chargingPlan = computed((): ChargingPlan | null => {
  const plan = ways.value === undefined ? null : usualPlan.value;
  return plan && ways.value && isSlow.value ? slowed(plan, ways.value, reserve()) : plan;
});

const runner = new Latest<Stop>(async ({ station }, signal) => {
  const found = await waysTo(station).catch(() => null);
  if (!signal.aborted) ways.value = found;
}, 0);

export function keepWays(): void {
  effect(() => {
    const [first] = usualPlan.value?.stops ?? [];
    const isAway = first && first.position_m >= HERE_M;
    // who leaves with less than the reserve has the chance to get there at all
    const chance = journey.value?.verdict.reason === BELOW ? first?.p_reach : usualPlan.value?.p_arrive;
    const doubtful = isAway && isLow.value && (chance ?? 1) < CERTAIN ? first : null;
    untracked(() => {
      ways.value = doubtful ? undefined : null;
      runner.submit(doubtful);
    });
  });
}
