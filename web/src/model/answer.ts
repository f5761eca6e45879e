/** What a driver asks of a whole trip, charging stops included: does it arrive, with what, when. */

import type { ChargingPlan, Forecast, Stop } from "../api/documents";
import { arrivalBand, chanceAtAll, chanceOf, type Verdict, verdictOf } from "./arrival";

/** Reason of a verdict: the reserve counts from the first stop on. */
export const BELOW = "leaves_below_reserve";

export interface Answer {
  /** To arrive at all. */
  pArrive: number;
  /** To keep the reserve at every stop and at the end; null where the service has none for it. */
  pReserve: number | null;
  soc: number;
  interval: readonly [number, number];
  energyWh: number;
  distanceM: number;
  drivingS: number;
  /** With the time to begin and to end each stop. */
  chargingS: number;
  /** Of it, to begin and to end the stops that are in no pause. */
  overheadS: number;
  charges: number;
}

export function answerOf(forecast: Forecast, reserve: number): Answer {
  const { series } = forecast;
  return {
    pArrive: chanceAtAll(forecast),
    pReserve: chanceOf(forecast, reserve),
    soc: forecast.soc_arrival,
    interval: arrivalBand(forecast),
    energyWh: forecast.energy_wh,
    distanceM: series.distance_m.at(-1) as number,
    drivingS: series.time_s.at(-1) as number,
    chargingS: 0,
    overheadS: 0,
    charges: 0,
  };
}

export function answerWithStops(plan: ChargingPlan): Answer {
  const [low = 0, high = 0] = plan.soc_interval;
  return {
    pArrive: plan.p_arrive,
    pReserve: plan.p_reserve,
    soc: plan.soc_arrival,
    interval: [low, high],
    energyWh: plan.energy_wh,
    distanceM: plan.course.position_m.at(-1) ?? 0,
    drivingS: plan.driving_s,
    chargingS: plan.charging_s,
    overheadS: plan.stops.reduce((sum, { overhead_s, pause_s }) => sum + (pause_s > 0 ? 0 : overhead_s), 0),
    charges: plan.stops.length,
  };
}

/** With the reserve where that chance is known. */
export function decisiveChance({ pReserve, pArrive }: Answer): number {
  return pReserve ?? pArrive;
}

/** The first stop with at least half of the risk of a plan; null where the plan keeps the reserve, or its end has the risk. */
export function riskyStop({ stops, p_reserve }: Pick<ChargingPlan, "stops" | "p_reserve">): Stop | null {
  if (verdictOf(p_reserve) === "good") return null;
  return stops.find(({ p_reach }) => 1 - p_reach >= (1 - p_reserve) / 2) ?? null;
}

/** Good if the reserve is kept, open if the car arrives at all in 9 of 10 trips. */
export function verdictOfAnswer(answer: Pick<Answer, "pArrive" | "pReserve">): Verdict {
  if (verdictOf(answer.pReserve ?? answer.pArrive) === "good") return "good";
  return answer.pArrive >= 0.9 ? "open" : "bad";
}
